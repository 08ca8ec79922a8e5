"""Wheel controllers: speeds settle, moves arrive, and the last command wins."""

import pytest

from khepera_emulator.body.motors import Gains, Mode, Profile, Wheel
from khepera_emulator.models import KHEPERA


def wheel() -> Wheel:
    return Wheel(
        KHEPERA.motor,
        Gains(*KHEPERA.speed_gains),
        Gains(*KHEPERA.position_gains),
        Profile(*KHEPERA.profile),
    )


def run(turning: Wheel, periods: int) -> list[float]:
    """Let an unhindered wheel turn; its speed after each period."""
    speeds = []
    for _ in range(periods):
        free = turning.control()
        turning.roll((turning.speed + free) / 2, free)
        speeds.append(free)
    return speeds


def run_until_reached(turning: Wheel, limit: int = 3000) -> list[float]:
    speeds = []
    while not turning.reached:
        speeds += run(turning, 1)
        assert len(speeds) < limit, f"target not reached: {turning.error} counts are left"
    return speeds


@pytest.mark.parametrize("speed", [-100, -20, -5, -3, 2, 5, 10, 20, 60, 120])
def test_a_speed_settles_without_steady_error(speed: int) -> None:
    turning = wheel()
    turning.drive_speed(speed)
    run(turning, 100)
    before = turning.travel
    run(turning, 200)
    assert (turning.travel - before) / 200 == pytest.approx(speed, abs=0.05)
    assert abs(turning.error) <= 2


@pytest.mark.parametrize("speed", [5, 20, 60])
def test_a_speed_is_near_after_a_tenth_of_a_second(speed: int) -> None:
    turning = wheel()
    turning.drive_speed(speed)
    assert run(turning, 12)[-1] == pytest.approx(speed, rel=0.3)


def test_stopping_comes_to_a_full_stop() -> None:
    turning = wheel()
    turning.drive_speed(20)
    run(turning, 50)
    turning.drive_speed(0)
    run(turning, 100)
    place = turning.counter
    run(turning, 100)
    assert turning.counter == place
    assert turning.at_rest()


@pytest.mark.parametrize("target", [1, -2, 10, 262, -262, 1000, 5000])
def test_a_move_reaches_its_target(target: int) -> None:
    turning = wheel()
    turning.drive_position(target)
    run_until_reached(turning)
    run(turning, 100)
    assert abs(turning.counter - target) <= 1
    assert turning.reached
    assert turning.error == target - turning.counter


def test_a_move_keeps_to_the_profile_in_speed_and_time() -> None:
    turning = wheel()
    turning.drive_position(5000)
    speeds = run_until_reached(turning)
    # 80 periods to 20 counts/10 ms at 0.25 a period, 800 counts at either end: 330 in all
    assert len(speeds) == pytest.approx(330, abs=25)
    assert max(speeds) == pytest.approx(20, abs=1)
    assert speeds[39] == pytest.approx(10, abs=1)


def test_a_slower_profile_takes_longer() -> None:
    turning = wheel()
    turning.profile = Profile(5, 16)
    turning.drive_position(1000)
    speeds = run_until_reached(turning)
    assert len(speeds) == pytest.approx(280, abs=25)
    assert max(speeds) == pytest.approx(5, abs=0.7)


@pytest.mark.parametrize("profile", [Profile(0, 64), Profile(20, 0)])
def test_a_profile_without_speed_goes_nowhere(profile: Profile) -> None:
    turning = wheel()
    turning.profile = profile
    turning.drive_position(100)
    run(turning, 100)
    assert turning.counter == 0
    assert not turning.reached


def test_a_new_target_during_a_move_turns_round() -> None:
    turning = wheel()
    turning.drive_position(2000)
    run(turning, 100)
    assert turning.counter > 400
    turning.drive_position(0)
    run_until_reached(turning)
    assert abs(turning.counter) <= 1


def test_counters_set_during_a_move_shift_its_end() -> None:
    turning = wheel()
    turning.drive_position(1000)
    run(turning, 80)
    before = turning.counter
    turning.counter = 0
    # the profile goes on from where the wheel is: no jerk to where it would have been
    assert max(run_until_reached(turning)) < 22
    assert abs(turning.counter - 1000) <= 1
    assert turning.travel == pytest.approx(before + 1000, abs=3)


@pytest.mark.parametrize(("start", "speed", "sign"), [(2**31 - 1, 5, -1), (-(2**31), -5, 1)])
def test_counters_wrap_at_32_bits(start: int, speed: int, sign: int) -> None:
    turning = wheel()
    turning.counter = start
    assert turning.counter == start
    turning.drive_speed(speed)
    run(turning, 50)
    assert turning.counter * sign > 2**31 - 1000


def test_the_last_command_wins() -> None:
    turning = wheel()
    turning.drive_position(100_000)
    run(turning, 150)
    turning.drive_speed(5)
    assert turning.mode is Mode.SPEED
    assert run(turning, 100)[-1] == pytest.approx(5, abs=1)
    turning.drive_duty(-100)
    assert run(turning, 100)[-1] == pytest.approx(-98 * 130 / 253, abs=0.5)
    turning.drive_position(turning.counter + 500)
    target = turning.target
    run_until_reached(turning)
    assert abs(turning.counter - target) <= 1


def test_taking_over_from_a_move_does_not_jerk() -> None:
    turning = wheel()
    turning.drive_position(100_000)
    speed = run(turning, 150)[-1]
    turning.drive_speed(20)
    assert run(turning, 10) == pytest.approx([speed] * 10, abs=4)


def test_duty_is_open_loop_and_friction_eats_a_part() -> None:
    turning = wheel()
    turning.drive_duty(1)
    assert run(turning, 50)[-1] == 0.0
    turning.drive_duty(255)
    assert run(turning, 100)[-1] == pytest.approx(130, abs=0.1)
    assert turning.error == 0


def test_speed_gains_change_the_motion() -> None:
    # without the integral part the wheel keeps a steady error
    turning = wheel()
    turning.speed_gains = Gains(3800, 0, 100)
    turning.drive_speed(20)
    assert run(turning, 200)[-1] < 19
    turning.speed_gains = Gains(0, 0, 0)
    assert run(turning, 200)[-1] == 0.0


def test_position_gains_change_the_motion() -> None:
    # only gains bring a wheel back that was pushed away after it had arrived
    held, loose = wheel(), wheel()
    loose.position_gains = Gains(0, 0, 0)
    for turning in (held, loose):
        turning.drive_position(800)
        run_until_reached(turning)
        turning.roll(-50.0, 0.0)
        run(turning, 100)
    assert abs(held.error) <= 1
    assert loose.error == pytest.approx(50, abs=2)


def test_a_held_wheel_reads_what_it_really_turned() -> None:
    turning = wheel()
    turning.drive_speed(20)
    for _ in range(50):
        turning.control()
        turning.roll(0.0, 0.0)
    assert turning.measured == 0
    assert turning.counter == 0
    assert turning.error == 20


def test_a_wheel_pushed_over_the_edge_of_the_counter_comes_back() -> None:
    turning = wheel()
    turning.counter = 2**31 - 1
    turning.drive_position(0)
    turning.roll(5.0, 0.0)
    assert turning.counter < 0
    assert turning.control() < 0.0


def test_a_move_begins_beyond_the_edge_of_the_counter() -> None:
    turning = wheel()
    turning.counter = 2**31 - 1
    turning.roll(5.0, 0.0)
    turning.drive_position(0)
    assert turning.control() == pytest.approx(0.0, abs=5.0)


def test_the_error_holds_32_bits() -> None:
    turning = wheel()
    turning.counter = -(2**31)
    turning.drive_position(2**23 - 2)
    assert turning.error == 2**23 - 2 - 2**31


@pytest.mark.parametrize(("within", "reached"), [(0, False), (100, True)])
def test_a_move_counts_as_reached_within_some_counts(within: int, reached: bool) -> None:
    turning = wheel()
    turning.reached_within = within
    turning.position_gains = Gains(0, 0, 0)
    turning.drive_position(800)
    run(turning, 50)
    turning.roll(-20.0, 0.0)
    run(turning, 150)
    assert turning.error != 0
    assert turning.reached == reached
