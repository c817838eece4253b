"""Phases of the stepping loop, its outcomes, and the reasons of a pause.

A phase is a function that returns the number of the next one, or that of an outcome or a pause.
"""

from __future__ import annotations

#: Outcomes of the loop.
REACHED_END = 0
TOO_MANY_STEPS = 1
TOO_MANY_CROSSINGS = 2
STEP_TOO_SMALL = 3
NOT_FINITE = 4
NOT_UNIQUE = 5
NO_CONTINUATION = 6
ACCUMULATION = 7
BEYOND_WALL = 8
NO_SWITCH_STATE = 9
RESET_NOT_FINITE = 10
ENDLESS_EVENTS = 12
MANY_PENDING = 13

#: Not finished: after a plain step or a crossing in a region, the lanes may take the next step.
HANDED_OVER = -1

#: Paused between two steps, to be resumed by the next call with identical results: the work
#: quota is used up, a table is full, code is needed that is not loaded, or a motion is needed that
#: is not formed.
OUT_OF_WORK, OUT_OF_ROWS, NEEDS_COLLOCATION, NEEDS_RADAU, NEEDS_MOTION = -2, -3, -4, -5, -6

#: Phases.
(
    # begin, here and after a pause: with space in the tables a motion is selected where the last
    # one has ended, else the next step is taken
    BEGIN,
    # decide whether the interface of the last event is crossed, or is a wall or switch whose
    # relation has become true
    DECIDE,
    # apply the event that is due: the reset of a wall, or the changes of switches
    APPLY,
    # select the motion that continues from this point
    SELECT,
    # compare the motion with the walls and switches at this point, of which another may be due
    CONTACT,
    # record the crossings of the selected motion
    CROSS,
    # pass an instant known in advance, or end at the end of time
    PASS,
    # expand the series of the motion
    EXPAND,
    # take an implicit step, where stability limits the series and no event is near
    SETTLE,
    # locate the first event within a step of the series
    LOCATE,
    # advance to the end of the step, and record it
    ADVANCE,
) = range(100, 111)

#: Consecutive events, separated by no more than rounding of time, that end a run.
CROWD = 40
