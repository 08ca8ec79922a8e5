"""A layout of panels in which Foxglove and Lichtblick show a robot.

Both import it as a file. It names topics of one robot; what a recording lacks stays empty.
"""

from typing import Any, Final

_THREE_D: Final = "3D!scene"
_IMAGE: Final = "ImageViewPanel!camera"
"""The older of its two names: newer viewers take it for the other, older ones know no other."""

_EARNED: Final = "Plot!reinforcement"
_INFRARED: Final = "Plot!infrared"
_STATES: Final = "StateTransitions!run"
_WIRE: Final = "RosOut!wire"
_DECISION: Final = "RawMessages!decision"

_SENSORS: Final = 8
_SCENE: Final = ("arena", "robot", "infrared", "plan", "way")
_FRAMES: Final = ("arena", "odometry", "robot")


def layout(robot: str) -> dict[str, Any]:
    """Return the layout for one robot, as JSON.

    Args:
        robot: its name in the keys.
    """
    decision = f"macor/{robot}/decision"
    return {
        "configById": {
            _THREE_D: _three_d(robot),
            _IMAGE: {"foxglovePanelTitle": "Camera", "cameraTopic": f"macor/{robot}/frame"},
            _EARNED: _plot(
                "Reinforcement",
                (f"{decision}.reinforcement", "earned"),
                (f"{decision}.situation.match", "match"),
            ),
            _INFRARED: _plot(
                "Infrared, 0 far to 1023 near",
                *((f"{decision}.infrared[{k}]", f"{k}") for k in range(_SENSORS)),
            ),
            _STATES: {
                "foxglovePanelTitle": "Run",
                "isSynced": True,
                "paths": [
                    {"value": path, "timestampMethod": "receiveTime", "label": label}
                    for path, label in (
                        (f"macor/{robot}/state.phase", "phase"),
                        (f"{decision}.command", "command"),
                        (f"{decision}.situation.node", "situation"),
                    )
                ],
            },
            _WIRE: {
                "foxglovePanelTitle": "Serial line",
                "topicToRender": f"foxglove/{robot}/wire",
                "searchTerms": [],
                "minLogLevel": 1,
            },
            _DECISION: {"topicPath": decision, "diffEnabled": False},
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _beside(
            62,
            _above(68, _THREE_D, _beside(60, _INFRARED, _WIRE)),
            _above(45, _IMAGE, _above(45, _EARNED, _above(50, _STATES, _DECISION))),
        ),
    }


def _three_d(robot: str) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": "Arena",
        "followMode": "follow-position",
        "followTf": "robot",
        "cameraState": {
            "perspective": True,
            "distance": 0.7,
            "phi": 42,
            "thetaOffset": 25,
            "targetOffset": [0, 0, 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.01,
            "far": 100,
        },
        "scene": {"backgroundColor": "#eef0f4", "transforms": {"showLabel": False, "lineWidth": 0}},
        "transforms": {f"frame:{frame}": {"visible": False} for frame in _FRAMES},
        "layers": {},
        "topics": {f"foxglove/{robot}/{leaf}": {"visible": True} for leaf in _SCENE},
    }


def _plot(title: str, *paths: tuple[str, str]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {
                "value": path,
                "label": label,
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for path, label in paths
        ],
        "showLegend": True,
        "legendDisplay": "left",
        "showPlotValuesInLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 120,
    }


def _beside(share: int, left: Any, right: Any) -> dict[str, Any]:
    return {"direction": "row", "first": left, "second": right, "splitPercentage": share}


def _above(share: int, top: Any, bottom: Any) -> dict[str, Any]:
    return {"direction": "column", "first": top, "second": bottom, "splitPercentage": share}
