"""Events of a trajectory: crossings, contacts, resets and changes of switches."""
