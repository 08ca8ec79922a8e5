"""The reactive system: one step of internal simulation (end of section 2.4)."""

from macor_hil.mind.planners.anticipative import Anticipative


class Reactive(Anticipative):
    """The anticipative planner with a single wave step: only the next transition counts."""

    def __init__(self) -> None:
        super().__init__(max_steps=1)
