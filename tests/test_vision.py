"""From mirror image to features."""

import numpy as np
import pytest
from khepera_protocol.mirror import Mirror

from macor_hil.errors import CameraError
from macor_hil.mind.eyes.opponent import opponent_colours
from macor_hil.mind.eyes.receptive_fields import ReceptiveFields
from macor_hil.mind.eyes.unwrap import PanoramaSize, Unwrapper

MIRROR = Mirror()


def mirror_image_with_a_spot(azimuth_degrees: float) -> np.ndarray:
    """Black, with a white spot half-way between the radii; 0 degrees ahead, 90 to the left."""
    image = np.zeros((MIRROR.height, MIRROR.width, 3), np.uint8)
    radius = (MIRROR.inner + MIRROR.outer) / 2
    angle = np.radians(azimuth_degrees)
    x = round(MIRROR.centre_x - radius * np.sin(angle))
    y = round(MIRROR.centre_y - radius * np.cos(angle))
    image[y - 2 : y + 3, x - 2 : x + 3] = 255
    return image


@pytest.mark.parametrize(
    ("azimuth", "column"), [(0, 60), (90, 30), (-90, 90), (45, 45), (170, 3), (-170, 116)]
)
def test_unwrapping_puts_each_direction_in_its_column(azimuth: float, column: int) -> None:
    panorama = Unwrapper(MIRROR, PanoramaSize(120, 32))(mirror_image_with_a_spot(azimuth))
    row, brightest = np.unravel_index(panorama[..., 0].argmax(), panorama.shape[:2])
    assert abs(int(brightest) - column) <= 3
    assert abs(int(row) - 16) <= 2


def test_a_frame_of_another_size_is_refused_in_a_sentence() -> None:
    with pytest.raises(CameraError, match="160 x 160"):
        Unwrapper(MIRROR, PanoramaSize())(np.zeros((120, 160, 3), np.uint8))


@pytest.mark.parametrize(
    ("bgr", "opponent"),
    [
        ((0, 0, 0), (0.0, 0.5, 0.5)),
        ((255, 255, 255), (1.0, 0.5, 0.5)),
        ((0, 0, 255), (1 / 3, 1.0, 0.75)),
        ((0, 255, 0), (1 / 3, 0.0, 0.75)),
        ((255, 0, 0), (1 / 3, 0.5, 0.0)),
        ((0, 255, 255), (2 / 3, 0.5, 1.0)),
    ],
)
def test_opponent_colours(bgr: tuple[int, ...], opponent: tuple[float, ...]) -> None:
    image = np.full((1, 1, 3), bgr, np.uint8)
    assert opponent_colours(image)[0, 0] == pytest.approx(opponent, abs=1e-6)


def test_each_field_looks_most_into_its_own_direction() -> None:
    panorama = np.zeros((32, 120, 3), np.uint8)
    panorama[:, 30:40] = 255
    white = ReceptiveFields(12).raw(panorama).reshape(12, 3)[:, 0]
    assert white.argmax() == 3
    assert white[2] == pytest.approx(white[4])
    assert 0.1 < white[4] < white[3]
    assert white[9] == pytest.approx(0.0, abs=1e-6)
    # the fields share all light out among themselves
    assert white.mean() == pytest.approx(10 / 120, rel=0.05)


def test_the_mirror_image_of_what_is_seen_has_the_mirrored_features() -> None:
    rng = np.random.default_rng(4)
    panorama = rng.integers(0, 256, (32, 120, 3), dtype=np.uint8)
    fields = ReceptiveFields(12)
    seen = fields.raw(panorama)
    np.testing.assert_allclose(fields.raw(panorama[:, ::-1]), fields.mirrored(seen))
    assert not np.allclose(seen, fields.mirrored(seen))


def test_tuned_features_fill_zero_to_one() -> None:
    rng = np.random.default_rng(0)
    raw = rng.uniform(0.4, 0.6, (400, 36))
    fields = ReceptiveFields(12).tuned_to(raw)
    x = fields.tune(raw)
    assert x.min() == 0.0
    assert x.max() == 1.0
    assert 0.9 < np.ptp(np.percentile(x, [2, 98])) <= 1.0


def test_a_channel_without_contrast_is_not_amplified() -> None:
    raw = np.full((100, 36), 0.5)
    raw[:, 0::3] = np.linspace(0, 1, 100)[:, None]
    fields = ReceptiveFields(12).tuned_to(raw)
    assert (fields.low[1], fields.high[1]) == (0.0, 1.0)
    assert fields.high[0] > 0.9
