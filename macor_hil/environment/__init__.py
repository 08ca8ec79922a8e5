"""Gymnasium environments over a Khepera's serial port: any learner can be set beside MACOR.

Importing this module registers two ids with Gymnasium, and does nothing else:

    khepera/Commands-v0   Discrete(3): the paper's commands, left, right and straight on
    khepera/Wheels-v0     Box(2): speeds of the left and the right wheel, m/s

    gymnasium.make("macor_hil.environment:khepera/Commands-v0", port="khepera://corridor?seed=1")
    gymnasium.make_vec("macor_hil.environment:khepera/Commands-v0", num_envs=1024)
"""

from typing import Final

import gymnasium

from macor_hil.environment.single import LONGEST_HOLD as LONGEST_HOLD
from macor_hil.environment.single import CommandsEnv as CommandsEnv
from macor_hil.environment.single import KheperaEnv as KheperaEnv
from macor_hil.environment.single import WheelsEnv as WheelsEnv
from macor_hil.environment.terms import Observation as Observation
from macor_hil.environment.terms import Start as Start
from macor_hil.environment.terms import graded as graded
from macor_hil.runs.trials import MAX_COMMANDS

_KINDS: Final = ("Commands", "Wheels")

for _kind in _KINDS:
    gymnasium.register(
        f"khepera/{_kind}-v0",
        entry_point=f"macor_hil.environment.single:{_kind}Env",
        vector_entry_point=f"macor_hil.environment.many:{_kind}VectorEnv",
        max_episode_steps=MAX_COMMANDS,
    )
