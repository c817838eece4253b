"""Compiled functions in forks of a process that has no threads."""

import ctypes
import json
import os
import traceback
import warnings

from fastslow.kernels.compiler import model_code, store

CALL = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)
compiled_here = []


def source(number=1):
    return f"def field(mode, inputs, parameters, W):\n    W[0] = 3.0 * inputs[0] + {number}.0\n"


def use(number=1):
    """Value of a compiled function, read or compiled anew."""
    model_code._addresses.clear()
    inputs, out = (ctypes.c_double * 1)(2.0), (ctypes.c_double * 1)()
    CALL(model_code.load_function(source(number), "field"))(0, inputs, None, out)
    return out[0] - 6.0


original = model_code.object_code


def counted(build, **options):
    compiled_here.append(build)
    return original(build, **options)


def prepare():
    """Count what is compiled from now on."""
    model_code.object_code = counted


class Child:
    """A function in a fork of this process; `result` waits for what it returns."""

    def __init__(self, function, *arguments, uid=None, umask=0o022, **environment):
        self.reading, writing = os.pipe()
        self.process = os.fork()
        if self.process == 0:
            os.close(self.reading)
            try:
                answer = self._run(function, arguments, uid, umask, environment)
            except BaseException:
                answer = {"error": traceback.format_exc()}
            with os.fdopen(writing, "w") as stream:
                json.dump(answer, stream)
            os._exit(0)
        os.close(writing)

    @staticmethod
    def _run(function, arguments, uid, umask, environment):
        os.umask(umask)
        for name in ("FASTSLOW_CACHE", "XDG_CACHE_HOME", "HOME"):
            os.environ.pop(name, None)
        os.environ.update({name: str(value) for name, value in environment.items()})
        if uid is not None:
            os.setgroups([])
            os.setgid(uid)
            os.setuid(uid)
        compiled_here.clear()
        store._warned.clear()
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            value = function(*arguments)
        texts = [str(warning.message) for warning in said]
        return {"value": value, "compiled": len(compiled_here), "said": texts}

    def result(self):
        with os.fdopen(self.reading) as stream:
            text = stream.read()
        status = os.waitpid(self.process, 0)[1]
        answer = json.loads(text) if text else {}
        return {**answer, "signal": os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0}


def run(function, *arguments, **given):
    return Child(function, *arguments, **given).result()
