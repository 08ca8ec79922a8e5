"""The renderer of the cameras: the skyline, and before it all that stands or hangs in the arena."""

from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.senses.renderers.foreground import paint
from khepera_emulator.senses.renderers.skyline import Skyline
from khepera_emulator.senses.renderers.view import Grid, Image
from khepera_emulator.world.looks import plan_looks
from khepera_emulator.world.world import Shown, World


class LayeredRenderer:
    """Everything around a point, as an equirectangular atlas.

    Args:
        world: what is seen.
        height: metres of the viewpoint above the floor.
        low, high: elevations in radians that the atlas shows.
        own: the robot that carries the camera, and is not seen by it.
    """

    def __init__(
        self, world: World, height: float, low: float, high: float, own: Shown | None = None
    ) -> None:
        self._world = world
        self._height = height
        self._own = own
        self._skyline = Skyline(world.arena, world.plan, height, low, high)
        self._still = plan_looks(world.arena, world.plan, self._skyline.top)

    def render(self, pose: Pose) -> Image:
        """Return the atlas: from behind over left, ahead and right to behind again."""
        view = self._skyline.look(pose)
        looks = [*self._still, *self._world.looks(self._own)]
        if looks:
            paint(looks, (pose.x, pose.y, self._height), self._skyline, view)
        return view.picture

    def place(self, azimuth: Grid, elevation: Grid) -> tuple[Grid, Grid]:
        """Return column and row of directions in the atlas; see `Renderer.place`."""
        return self._skyline.place(azimuth, elevation)
