"""The state machine of `line_machine`, for a few steps; `make soak` takes a hundred thousand."""

from hypothesis import settings
from line_machine import LineMachine

TestAnyOrder = LineMachine.TestCase
TestAnyOrder.settings = settings(max_examples=12, stateful_step_count=20)
