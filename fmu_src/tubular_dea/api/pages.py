"""Pages for browsers: the laboratory, the atlas of residuals, and the handbook."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..files import write_atomically
from ..plants.plant import Plant
from .given import AnyModel, AnyPlant, items, model_of, plant_of
from .recordings import Data, folder_of, recordings_of
from .work import steps

if TYPE_CHECKING:
    from ..discover.experiments.atlas import Atlas


@dataclass(frozen=True)
class WebPage:
    """One page that opens in any browser without a network: `html`, and `remarks` about it."""

    html: str = field(repr=False)
    remarks: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """What was left out, or how much there is, as text."""
        return list(self.remarks)

    def write(self, path: str | Path) -> Path:
        """Write the page as one file; returns its path."""
        target = Path(path)
        if target.is_dir():
            raise ArgumentError("out", f" {target}: expected the name of a file, as in lab.html, but it is a folder")
        return write_atomically(target, self.html.encode("utf-8"))


@dataclass(frozen=True)
class AtlasPage(WebPage):
    """The atlas of residuals as a page; `atlas` has the signatures of all effects as numbers."""

    atlas: Atlas = field(kw_only=True, repr=False)


def lab_page(model: AnyModel | None = None, data: Data | None = None, *, plant: AnyPlant = "tube") -> WebPage:
    """A page for any browser: the tube, the assisted heart and recordings, live.

    Parameters
    ----------
    model : Model, Plant, str or Path, optional
        What the page shows (default: the plant's own model).
    data : str, Path or RecordingSet, optional
        A folder of recordings, or what `read_recordings` has read, to open with.
    plant : Plant, str or Path
        The plant of the model and the recordings.

    Returns
    -------
    WebPage
        Write it with ``page.write("lab.html")``.

    Raises
    ------
    UserError
        For a model of another plant, and for a page larger than 1.5 MB.

    Examples
    --------
    >>> import tubular_dea as td
    >>> td.lab_page().write("lab.html").name
    'lab.html'
    """
    from ..lab.page import Content, page
    from ..lab.recorded import Carried, carried

    chosen = plant_of(plant)
    shown = chosen.model if model is None else model_of(model, chosen)
    if shown.name != chosen.name:
        where = f" {model}" if isinstance(model, str | Path) else ""
        raise ArgumentError("model", f"{where}: expected a model of {chosen.name} but it holds {shown.name}")
    recordings = None if data is None else recordings_of(data, chosen)
    content = Content(
        plant=chosen,
        model=shown,
        recordings=carried(recordings) if recordings else Carried({}, {}),
        geometry=recordings.geometry if recordings else {},
        model_file=str(model) if isinstance(model, str | Path) else "",
        plant_file=_called(plant),
        data=folder_of(recordings) if recordings else "",
    )
    return WebPage(page(content), tuple(content.recordings.words()))


def atlas_page(plant: AnyPlant = "tube", *, progress: bool = False) -> AtlasPage:
    """A page with the signature of every effect of a plant's catalogue: its equation, usual size and residual.

    Parameters
    ----------
    plant : Plant, str or Path
        A plant, ``"tube"``, ``"aorta"``, or ``"FILE.py[:NAME]"``.
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    AtlasPage
        Write it with ``page.write("atlas.html")``; ``page.atlas`` has the numbers.

    Raises
    ------
    UserError
        For a plant that cannot be loaded.

    Examples
    --------
    The aorta's own effects, without the laws at its places:

    >>> from dataclasses import replace
    >>> import tubular_dea as td
    >>> page = td.atlas_page(replace(td.load_plant("aorta"), places=()))
    >>> sorted(left.effect.id for left in page.atlas.effects)
    ['inertance', 'outflow_pressure', 'parallel_inertance']
    """
    from ..discover.experiments.atlas import atlas
    from ..report.atlas import page

    chosen, called = plant_of(plant), _called(plant)
    given = f" --plant {called}" if called else ""
    with steps(progress, 2 + len(chosen.catalogue)) as tell:
        found = atlas(chosen, tell)
    html = page(found, f"tubular-dea close-loop DATA{given} --out OUT").document()
    return AtlasPage(html, (f"{len(found.effects)} effects",), atlas=found)


def handbook_page(plant: AnyPlant = "tube", *, commands: Mapping[str, str] | None = None) -> WebPage:
    """A page with all models, effects, laws and these functions, printed from what is declared.

    For a plant of your own it has that plant in the place of this package's.

    Parameters
    ----------
    plant : Plant, str or Path
        ``"tube"`` or ``"aorta"``, which comes first, or ``"FILE.py[:NAME]"``.
    commands : mapping of str to str, optional
        Help texts by name, for one more section: the command line gives its own (default: none).

    Returns
    -------
    WebPage
        Write it with ``page.write("handbook.html")``.

    Raises
    ------
    UserError
        For a plant that cannot be loaded.

    Examples
    --------
    >>> import tubular_dea as td
    >>> page = td.handbook_page("aorta")
    >>> "What AorticAfterload may lack" in page.html, "tubular_dea.sweep.plan" in page.html
    (True, True)
    """
    import tubular_dea

    from ..cosim.heart_assist import models as heart_models
    from ..plants.load import SHIPPED, shipped
    from ..report.handbook import handbook

    chosen = plant_of(plant)
    ours = list(map(shipped, SHIPPED))
    own = chosen.name not in [p.name for p in ours]
    plants = [chosen] if own else [chosen, *(p for p in ours if p.name != chosen.name)]
    models = {m.name: m for m in (*(p.model for p in plants), *(() if own else heart_models(controlled=True).values()))}
    public = {name: getattr(tubular_dea, name) for name in tubular_dea.__all__}
    return WebPage(handbook(models.values(), plants, public, dict(items("commands", commands))))


def _called(plant: AnyPlant) -> str:
    """How commands call a plant; "" for the tube."""
    if isinstance(plant, Plant):
        return plant.file
    return "" if str(plant) == "tube" else str(plant)
