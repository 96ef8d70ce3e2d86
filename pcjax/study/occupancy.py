"""Where objects stay in the hand of a study, and from where they escape."""

from __future__ import annotations

from pcjax.quality.occupancy import CELLS, TRIALS, Occupancy, occupancy
from pcjax.study.spec import Study


def occupancy_of_study(
    study: Study,
    *,
    trials: int = TRIALS,
    first: int = 0,
    cells: int = CELLS,
    progress: bool = False,
) -> dict[str, Occupancy]:
    """`pcjax.occupancy` of the hand of a study in each direction that the study asks for; its sweep
    and its number of trials are not looked at.

    Arguments:
        study: what is looked at: its seed, limit, engine and precision.
        trials, first, cells, progress: as for `pcjax.occupancy`.

    Raises:
        ValueError: see `pcjax.occupancy`, and EoEn of a hand that has none.

    Examples:
        >>> import pcjax
        >>> run = pcjax.Run(max_steps=20_000)
        >>> study = pcjax.Study(pcjax.box_hand(), pcjax.Circle(25.0), run=run)
        >>> found = pcjax.occupancy_of_study(study, trials=64)
        >>> list(found), found["does"].trials
        (['does', 'eoen'], 64)
    """
    run = study.run
    return {
        direction: occupancy(
            scenario,
            trials=trials,
            first=first,
            max_steps=study.max_steps,
            seed=run.seed,
            engine=run.engine,
            dt=run.dt,
            precision=run.precision,
            cells=cells,
            progress=progress,
        )
        for direction, scenario in study.scenarios().items()
    }
