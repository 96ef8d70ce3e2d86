"""The page: the hand to drag, its numbers, and what can be done with it."""

from __future__ import annotations

from asyncio import to_thread
from functools import partial
from pathlib import Path
from typing import TypeVar

from nicegui import app, events, ui

from pcjax.study.spec import Study
from pcjax.view.web.along import Along
from pcjax.view.web.canvas import Canvas
from pcjax.view.web.desk import Desk
from pcjax.view.web.files import EXPORTS, STUDIES, listed, open_study, save_study
from pcjax.view.web.improve import Improve
from pcjax.view.web.looks import AT_REST, experiment_of
from pcjax.view.web.numbers import Curves, Numbers
from pcjax.view.web.panel import Panel
from pcjax.view.web.studio import Studio
from pcjax.view.web.watch import Watch
from pcjax.view.web.where import Where

S = TypeVar("S", bound=Studio)

STYLE = Path(__file__).with_name("style.css")


def warm_up(study: Study) -> None:
    """Compiles what the page runs, so that the first move does not have to wait for it.

    Raises:
        ValueError: the study cannot be evaluated.
    """
    experiment = experiment_of(study)
    for trials in AT_REST[:3]:
        experiment.go_on(trials)


async def page(study: Study, name: str, folder: Path) -> None:
    """Builds the page of one visitor, whose design is nobody else's.

    Arguments:
        study, name: what it begins with, and the name of its file.
        folder: where files may be read and written.
    """
    studio = await opened(study, name, folder, Studio)
    if studio is None:
        return
    with ui.element("main").classes("columns"):
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("card hand"):
                canvas = Canvas(studio)
                Watch(studio, canvas)
                Where(studio, canvas)
            Curves(studio)
        with ui.element("div").classes("stack"):
            Numbers(studio)
            _tabs(studio, canvas)
    studio.tell()


async def opened(study: Study, name: str, folder: Path, kind: type[S]) -> S | None:
    """What every page has: a design that outlasts a reload, and the bar; None if whoever asked has
    gone.

    Arguments:
        study, name, folder: as for `page`.
        kind: of the studio.
    """
    ui.add_css(STYLE)
    dark = ui.dark_mode(None)
    await ui.context.client.connected()
    if not ui.context.client.has_socket_connection:
        return None  # or it is no browser
    kept = app.storage.tab
    desk = kind.desks.again(kept["desk"]) if "desk" in kept else kind.desks.of(study, name)

    def keep(desk: Desk) -> None:
        kept["desk"] = desk.kept()

    studio = kind(desk, folder, keep)
    client = ui.context.client

    def refused(why: str) -> None:
        with client:  # it may be said by what goes on in the background
            ui.notify(why, type="negative", multi_line=True)

    studio.refused = refused
    client.on_delete(partial(_close, studio))
    _bar(studio, dark)
    return studio


def _close(studio: Studio) -> None:
    studio.closed = True


def _tabs(studio: Studio, canvas: Canvas) -> None:
    with ui.element("section").classes("card"):
        with ui.tabs().props("dense no-caps align=left") as tabs:
            design = ui.tab("design")
            improve = ui.tab("improve")
            along = ui.tab("sweep")
        with ui.tab_panels(tabs, value=design).props("keep-alive"):
            with ui.tab_panel(design):
                Panel(studio)
            with ui.tab_panel(improve):
                Improve(studio, canvas)
            with ui.tab_panel(along):
                Along(studio)


def _bar(studio: Studio, dark: ui.dark_mode) -> None:
    with ui.element("header").classes("bar"):
        ui.label("pcjax").classes("title")
        name = ui.label().classes("name")
        name.props["data-testid"] = "name"
        for text, icon, words, act in (
            ("open", "folder_open", "open a study file", partial(_open, studio)),
            ("save", "save", "save as a study file", partial(_save, studio)),
            ("undo", "undo", "undo (Ctrl+Z)", studio.undo),
            ("redo", "redo", "redo (Ctrl+Y)", studio.redo),
            ("reset", "restart_alt", "as it was opened", studio.reset),
            ("pin", "push_pin", "compare what follows with this design", studio.pin),
        ):
            button = ui.button(icon=icon, on_click=act).props("flat dense")
            button.props["aria-label"] = words
            button.props["data-testid"] = text
            button.tooltip(words)
        with ui.button(icon="download").props("flat dense") as export:
            export.props["aria-label"] = "export"
            export.props["data-testid"] = "export"
            with ui.menu():
                for ending in studio.exports:
                    item = ui.menu_item(ending.upper(), partial(_export, studio, ending))
                    item.props["data-testid"] = f"export-{ending}"
        shade = ui.button(icon="contrast", on_click=partial(_shade, dark)).props("flat dense")
        shade.props["aria-label"] = "light or dark"
        shade.props["data-testid"] = "shade"

    def called() -> None:
        name.set_text(studio.desk.name or "a design without a file")

    called()
    studio.on_named.append(called)
    ui.keyboard(on_key=partial(_key, studio), ignore=["input", "textarea"])


def _shade(dark: ui.dark_mode) -> None:
    """Light, dark, or as the system has it."""
    dark.value = {None: True, True: False, False: None}[dark.value]


def _key(studio: Studio, event: events.KeyEventArguments) -> None:
    if not (event.action.keydown and (event.modifiers.ctrl or event.modifiers.meta)):
        return
    if event.key.name.lower() == "z":
        (studio.redo if event.modifiers.shift else studio.undo)()
    elif event.key.name.lower() == "y":
        studio.redo()


async def _ask(title: str, what: str, names: list[str], usual: str) -> str | None:
    """Asks for the name of a file; None if it was thought better of."""
    with ui.dialog() as dialog, ui.card():
        ui.label(title).classes("text-lg")
        typed = ui.input("file, from the folder of the page", value=usual)
        typed.props["data-testid"] = "file"
        typed.props("autofocus").classes("w-80")
        if names:
            chosen = ui.select(names, label="or one of these").classes("w-80")
            chosen.on_value_change(lambda event: typed.set_value(event.value))
        with ui.element("div").classes("line"):
            done = ui.button(what, on_click=lambda: dialog.submit(typed.value)).props("no-caps")
            done.props["data-testid"] = "file-done"
            ui.button("cancel", on_click=lambda: dialog.submit(None)).props("no-caps flat")
        typed.on("keydown.enter", lambda: dialog.submit(typed.value))
    name = await dialog
    dialog.delete()
    return name


async def _open(studio: Studio) -> None:
    names = await to_thread(listed, studio.folder, STUDIES)
    name = await _ask("Open a study or a drawn hand", "open", names or [], studio.desk.name)
    if name is None:
        return
    try:
        study, doubts = await to_thread(open_study, studio.folder, name)
    except ValueError as error:
        studio.refused(str(error))
        return
    if study.dimensions != studio.desk.study.dimensions:
        studio.refused(f"the page of {name.strip()} is another one: pcjax view {name.strip()}")
        return
    # A drawing is not written over: its study is to be saved under another name.
    studio.open(study, name.strip() if name.strip().lower().endswith(".toml") else "")
    for doubt in doubts:
        ui.notify(doubt, type="warning", multi_line=True)
    ui.notify(f"opened {name.strip()}", type="positive")


async def _save(studio: Studio) -> None:
    name = await _ask("Save the study", "save", [], studio.desk.name or "hand.toml")
    if name is None:
        return
    try:
        written = await to_thread(
            save_study, studio.folder, name, studio.desk.study, studio.desk.name
        )
    except ValueError as error:
        studio.refused(str(error))
        return
    studio.rename(written)
    ui.notify(f"saved {written}", type="positive")


async def _export(studio: Studio, ending: str) -> None:
    study, last = studio.desk.study, studio.last
    found = last.found if last is not None and last.study is study else None
    try:
        content = await to_thread(EXPORTS[ending], study, found)
    except ValueError as error:
        studio.refused(str(error))
        return
    stem = Path(studio.desk.name or "hand").stem
    ui.download(content, f"{stem}.{ending}")
