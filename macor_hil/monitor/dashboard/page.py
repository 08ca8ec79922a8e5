"""The page: cards with drawings that follow the state of the robot."""

from contextlib import AbstractContextManager
from html import escape
from typing import Final

from nicegui import Client, ui
from nicegui.events import KeyEventArguments

from macor_hil.monitor.dashboard import arena, charts, eyes, texts
from macor_hil.monitor.dashboard.failures import Failures
from macor_hil.monitor.dashboard.sources import RecordingSource, Source
from macor_hil.monitor.dashboard.ticks import again_and_again

_PERIOD: Final = 0.1
"""Seconds between two looks at what is new."""

_STYLE: Final = """
body { background: #0b0e14; color: #e8eaf0; }
.board { display: grid; gap: 12px; grid-template-columns: minmax(0, 1fr); width: 100%; }
.card { background: #151a24; border: 1px solid #262d3d; border-radius: 10px; padding: 12px;
        min-width: 0; }
.card h2 { font-size: 13px; line-height: 1.4; font-weight: 600; letter-spacing: .04em;
           color: #aab2c5; margin: 0 0 6px 0; }
.words { font-size: 13px; color: #c3c9d8; }
.wire { font: 11.5px/1.45 ui-monospace, monospace; white-space: pre; overflow-x: auto;
        color: #b8f0c8; margin: 0; min-height: 17em; }
dl.words { display: grid; grid-template-columns: max-content 1fr; gap: 2px 12px; margin: 0; }
dl.words dt { color: #8b93a7; }
dl.words dd { margin: 0; }
.arena svg { max-height: 62vh; }
.columns { overflow-x: auto; }
.columns svg { min-width: 600px; }
.gone > :not(h2) { filter: grayscale(1); opacity: .5; }
.mirror svg { image-rendering: pixelated; max-width: 300px; margin: 0 auto; }
.ring svg { max-width: 260px; margin: 0 auto; }
@media (min-width: 1100px) {
  .board { grid-template-columns: repeat(12, minmax(0, 1fr)); }
  .arena { grid-column: span 5; grid-row: span 2; }
  .eyes { grid-column: span 4; grid-row: span 2; }
  .decision { grid-column: span 3; }
  .ring { grid-column: span 3; }
  .columns { grid-column: span 12; }
  .rewards { grid-column: span 5; }
  .health { grid-column: span 3; }
  .line { grid-column: span 4; }
}
"""


class Page:
    """One browser's view of a source.

    Args:
        source: what to show.
        failures: what went wrong in pages.
    """

    def __init__(self, source: Source, failures: Failures) -> None:
        self._source = source
        self._failures = failures
        self._cards: dict[str, ui.element] = {}
        self._held = False
        self._shown = -1
        ui.dark_mode(value=True)
        ui.add_css(_STYLE)
        ui.page_title(f"{source.watched.robot} · macor-hil")
        self._head()
        with ui.element("main").classes("board"):
            self._arena = self._drawing("arena", "Arena: the way driven, sequences weighed")
            with self._card("eyes", "Camera and receptive fields"):
                self._mirror = _svg("mirror")
                self._panorama = _svg("q-mt-sm")
            with self._card("decision", "Decision"):
                self._situation = ui.label().classes("words").mark("situation")
                self._alternatives = _svg("q-mt-sm")
            self._infrared = self._drawing("ring", "Infrared, ahead is up")
            self._columns = self._drawing("columns", "Columns: activity of every situation")
            with self._card("rewards", "Reinforcement"):
                self._totals = ui.label().classes("words")
                self._rewards = _svg("")
            with self._card("health", "Link and telemetry"):
                self._health = ui.html("", sanitize=False, tag="dl").classes("words")
            with self._card("line", "Serial line"):
                self._wire = ui.html("", sanitize=False, tag="pre").classes("wire")
                self._wire.props("tabindex=0")
        ui.keyboard(on_key=self._key)
        client = ui.context.client

        def tick() -> None:
            # when the browser is there: what fails then is shown on a page that is served
            if client.has_socket_connection:
                self._tick()

        again_and_again(_PERIOD, tick, lambda: client.id in Client.instances)

    def _head(self) -> None:
        with ui.row().classes("full-width items-center"):
            ui.label(self._source.watched.robot).classes("text-h6")
            self._status = ui.badge().props("role=status aria-live=polite").classes("text-body2")
            self._equipment = ui.label().classes("words")
            self._trouble = ui.label().classes("text-negative").props("role=alert")
            ui.space()
            self._hold = ui.button("Pause", on_click=self._toggle).props("outline dense no-caps")
            self._hold.tooltip("space")
        if isinstance(self._source, RecordingSource):
            self._scrubber(self._source)

    def _scrubber(self, player: RecordingSource) -> None:
        with ui.row().classes("full-width items-center no-wrap"):
            self._slider = (
                ui.slider(min=0.0, max=player.duration, step=0.01, value=0.0)
                .props('aria-label="moment of the recording"')
                .classes("col")
                .on("update:model-value", lambda event: _seek(player, event.args))
            )
            self._moment = ui.label().classes("words text-no-wrap")

    def _drawing(self, name: str, title: str) -> ui.html:
        with self._card(name, title):
            return _svg("")

    def _card(self, name: str, title: str) -> AbstractContextManager[ui.element]:
        card = ui.element("section").classes(f"card {name}").props(f'aria-label="{title}"')
        with card:
            ui.html(title, sanitize=False, tag="h2")
        self._cards[name] = card
        return card

    def _tick(self) -> None:
        self._trouble.text = self._failures.words()
        if isinstance(self._source, RecordingSource):
            self._source.poll()
        if not self._held:
            self._draw()

    def _draw(self) -> None:
        watched, now = self._source.watched, self._source.now
        self._say(now)
        if watched.version == self._shown:
            return
        self._shown = watched.version
        seen = watched.controlled
        self._arena.content = arena.arena(watched)
        self._mirror.content = eyes.mirror(watched)
        self._panorama.content = eyes.panorama(watched)
        self._alternatives.content = charts.alternatives(seen.decision)
        self._columns.content = charts.columns(seen.decision, seen.learned)
        self._rewards.content = charts.reinforcement(list(seen.history))
        self._infrared.content = charts.infrared(seen.decision.infrared if seen.decision else None)

    def _say(self, now: float) -> None:
        watched, source = self._source.watched, self._source
        text, colour = texts.status(watched, now)
        self._status.text = text
        self._status.props(f"color={colour}-9")
        self._equipment.text = texts.equipment(watched)
        self._situation.text = texts.situation(watched)
        self._totals.text = texts.totals(watched)
        self._health.content = _rows(texts.health(watched, now))
        self._wire.content = escape(texts.wire(watched))
        gone = texts.gone(watched)
        for name, card in self._cards.items():
            card.classes(add="gone" if name in gone else "", remove="" if name in gone else "gone")
        if isinstance(source, RecordingSource):
            self._slider.value = source.position
            self._moment.text = f"{source.position:.1f} / {source.duration:.1f} s"
            self._hold.text = "Pause" if source.playing else "Play"

    def _toggle(self) -> None:
        if isinstance(self._source, RecordingSource):
            self._source.toggle()
        else:
            self._held = not self._held
            self._hold.text = "Go on" if self._held else "Pause"

    def _key(self, event: KeyEventArguments) -> None:
        if not event.action.keydown:
            return
        if event.key == " " and not event.action.repeat:
            self._toggle()
        elif isinstance(self._source, RecordingSource):
            leaps = {"ArrowLeft": -1.0, "ArrowRight": 1.0, "Home": -1e9, "End": 1e9}
            leap = leaps.get(event.key.name)
            if leap is not None:
                self._source.seek(self._source.position + leap)


def _seek(player: RecordingSource, wanted: object) -> None:
    """Go where the slider is; it is of the browser's making."""
    if isinstance(wanted, int | float):
        player.seek(float(wanted))


def _svg(classes: str) -> ui.html:
    # drawings are made here, with everything from elsewhere escaped
    return ui.html("", sanitize=False).classes(classes)


def _rows(rows: list[tuple[str, str]]) -> str:
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in rows)
