"""FMU states: taken, set back, written out and read in."""

import pytest

from component import FMICallException
from coupling import SAMPLE_TIME, Pair, Scene

SCENE = Scene()


@pytest.fixture
def pair(instance):
    """A pair on its way to the lock, in the middle of everything."""
    plant = instance("LoViNes").start(SCENE.plant())
    controller = instance("PhaseLock").start(SCENE.controller())
    pair = Pair(plant, controller, SAMPLE_TIME)
    advance(pair, 2000)
    return pair


def advance(pair, samples):
    for _ in range(samples):
        pair.sample(active=True)
    return [pair.plant.outputs(), pair.controller.outputs()]


def components(pair):
    return pair.plant, pair.controller


def test_a_state_set_back_continues_bit_for_bit(pair):
    states = [one.slave.getFMUstate() for one in components(pair)]
    clock = pair.plant.time
    first = advance(pair, 1500)
    for one, state in zip(components(pair), states, strict=True):
        one.slave.setFMUstate(state)
        one.time = clock
    assert advance(pair, 1500) == first
    for one, state in zip(components(pair), states, strict=True):
        one.slave.freeFMUstate(state)


def test_a_state_written_out_continues_in_another_instance_bit_for_bit(pair, instance):
    twins = [instance(name).start() for name in ("LoViNes", "PhaseLock")]
    for one, twin in zip(components(pair), twins, strict=True):
        state = one.slave.getFMUstate()
        written = one.slave.serializeFMUstate(state)
        read = twin.slave.deSerializeFMUstate(written)
        twin.slave.setFMUstate(read)
        assert twin.slave.serializeFMUstate(read) == written
        twin.time = one.time
    assert advance(Pair(*twins, SAMPLE_TIME), 1500) == advance(pair, 1500)


def test_a_state_set_in_a_new_instance_needs_no_initialisation(pair, instance):
    twins = [instance(name) for name in ("LoViNes", "PhaseLock")]
    for one, twin in zip(components(pair), twins, strict=True):
        written = one.slave.serializeFMUstate(one.slave.getFMUstate())
        twin.slave.setFMUstate(twin.slave.deSerializeFMUstate(written))
        twin.time = one.time
    assert advance(Pair(*twins, SAMPLE_TIME), 100) == advance(pair, 100)


def test_bytes_that_are_no_state_are_refused_with_a_message(pair):
    plant, controller = components(pair)
    written = plant.slave.serializeFMUstate(plant.slave.getFMUstate())
    foreign = controller.slave.serializeFMUstate(controller.slave.getFMUstate())
    for wrong in (b"", written[:-1], written + b"\0", foreign, b"\xff" * len(written)):
        plant.messages.clear()
        with pytest.raises(FMICallException):
            plant.slave.deSerializeFMUstate(wrong)
        assert "serialised state" in plant.messages[-1].text


def test_a_master_may_take_thousands_of_states_and_free_none(instance):
    plant = instance("LoViNes").start(SCENE.plant())
    first = plant.slave.getFMUstate()
    for _ in range(5000):
        plant.slave.getFMUstate()
    plant.step(10.0)
    plant.slave.setFMUstate(first)
    assert plant.get("der(q2)") == SCENE.particle_velocity
