"""Cameras: sources of mirror images; `catalogue` tells how they are addressed."""

from macor_hil.hardware.cameras.camera import Camera, Frame
from macor_hil.hardware.cameras.catalogue import open_camera

__all__ = ["Camera", "Frame", "open_camera"]
