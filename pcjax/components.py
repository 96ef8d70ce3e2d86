"""Things that describe themselves: a hand, body, drive, contact law or engine, each number once.

A component is a class whose fields are declared with `quantity`. From the declarations come its
checks, the study file's reader and writer, the names that can be swept, and the command line's
flags with their help. A `Registry` finds the classes of a sort by their kind; installed packages
can add some, through an entry point of the registry's group.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import math
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields, replace
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, Literal, Self, TypeVar, cast, dataclass_transform

import equinox as eqx
import jax

from pcjax.checks import check_between, check_count, check_finite, check_positive, check_radians
from pcjax.units import PER_METRE, length_in_words
from pcjax.words import did_you_mean

Unit = Literal["length", "angle", "time", "speed", "acceleration", "rate", "mass", "1"]

_IN_WORDS = {
    "length": "in --units",
    "angle": "degrees",
    "time": "s",
    "speed": "length / s",
    "acceleration": "length / s^2",
    "rate": "1 / s",
    "mass": "any unit",
    "1": "",
}


_WITH_LENGTH = ("length", "speed", "acceleration")
"""Units that a length is part of."""


@dataclass(frozen=True)
class Quantity:
    """What one parameter of a component is.

    Attributes:
        unit: in Python; angles are radians there, and degrees in files and on the command line.
        help: what it is, in a few words.
        default: unless given; MISSING where the study says what is usual or it has to be given.
            What has a length in it is in model units.
        metric: the default where lengths are in metres, in metres; None: there is none then.
        low, high: the allowed range.
        above: whether `low` itself is not allowed.
        kind: float, or int, bool or str for what is part of the program.
        word: what files and the command line say for None, such as "random".
        count: of how many numbers it consists; None for one number.
        many: whether it is any number of such values, one or more.
        each: what one of several is called.
        key: its name in study files, without the unit; "" if it is none of theirs.
        flag: its name on the command line; "" if it has none.
        usual: in words, what it is unless given, where that is no number of its own.
        name: of the field.
    """

    unit: Unit
    help: str
    default: Any = MISSING
    metric: float | None = None
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    kind: type = float
    word: str = ""
    count: int | None = None
    many: bool = False
    each: str = "number"
    key: str = ""
    flag: str = ""
    usual: str = ""
    name: str = ""

    @property
    def file_key(self) -> str:
        """Its name in a study file: angles are in degrees and say so."""
        return self.key + ("_deg" if self.key and self.unit == "angle" else "")

    @property
    def file_keys(self) -> tuple[str, ...]:
        """All its names in a study file: the one for numbers, and the one for its word."""
        return tuple(dict.fromkeys((self.file_key, self.key) if self.word else (self.file_key,)))

    @property
    def unit_in_words(self) -> str:
        """As files and the command line have it."""
        return _IN_WORDS[self.unit]

    def unit_in(self, units: str) -> str:
        """As results have it, where lengths are in `units`."""
        length = length_in_words(units)
        words = {"length": length, "speed": f"{length} / s", "acceleration": f"{length} / s^2"}
        words |= {"angle": "degree", "time": "s", "rate": "1 / s"}
        return words.get(self.unit, "1")

    def default_in(self, units: str) -> Any:
        """The default where lengths are in `units` (see `pcjax.units`); MISSING: it has none."""
        sized = self.unit in _WITH_LENGTH and self.default not in (MISSING, None, 0)
        if not sized or units not in PER_METRE:
            return self.default
        return MISSING if self.metric is None else round(self.metric * PER_METRE[units], 9)

    def why_missing(self, units: str) -> str:
        """That it has to be given, and why if a default in model units does not do."""
        problem = f"{self.file_key or self.name} is missing"
        if units not in PER_METRE or (self.default is MISSING and not self.usual):
            return problem
        return f"{problem}: what is usual is in the paper's model units, and lengths are in {units}"

    def from_file(self, value: Any) -> Any:
        """What is written in a file or a flag, as Python has it."""
        if self.word and value == self.word:
            return None
        if self.many:
            return tuple(map(replace(self, many=False).from_file, value))
        if self.count is not None:
            return tuple(map(replace(self, count=None).from_file, value))
        if self.kind is int and value == round(value):
            return int(value)
        return math.radians(value) if self.unit == "angle" else value

    def to_file(self, value: Any) -> Any:
        """The value as files and the command line have it."""
        if value is None:
            return self.word
        if self.kind is not float:
            return value
        if self.many:
            return [replace(self, many=False).to_file(one) for one in value]
        if self.count is not None:
            return [replace(self, count=None).to_file(one) for one in value]
        number = float(value)
        return round(math.degrees(number), 9) if self.unit == "angle" else number

    def in_file(self) -> Quantity:
        """The same as files and the command line have it, by its name there."""
        if self.unit != "angle":
            return replace(self, name=self.file_key)
        low, high = (round(math.degrees(bound), 9) for bound in (self.low, self.high))
        return replace(self, name=self.file_key, low=low, high=high)

    def check(self, value: Any) -> None:
        """
        Raises:
            ValueError: it is out of range. Traced values are not looked at.
        """
        if value is None:
            return
        if self.many:
            for k, one in enumerate(value, start=1):
                replace(self, many=False, name=f"{self.name} {k}").check(one)
            return
        if self.count is None:
            self._check_one(self.name, value)
            return
        if len(value) != self.count:
            raise ValueError(
                f"{self.name} has {len(value)} values: there are {self.count} {self.each}s"
            )
        for k, one in enumerate(value, start=1):
            self._check_one(f"{self.name} of {self.each} {k}", one)

    def _check_one(self, name: str, value: Any) -> None:
        if self.kind is bool:
            if not isinstance(value, bool):
                raise ValueError(f"{name} is {value!r}: it has to be true or false")
            return
        if self.kind is str:
            if not isinstance(value, str):
                raise ValueError(f"{name} is {value!r}: it has to be a text")
            return
        if self.kind is int:
            check_count(name, value, int(self.low), int(self.high))
            return
        if self.above and self.low == 0 and self.high == math.inf:
            check_positive(name, value)
            return
        check_finite(name, value)
        if (self.low, self.high) != (-math.inf, math.inf):
            check_between(name, value, self.low, self.high)


def quantity(
    unit: Unit,
    help: str,
    *,
    default: Any = MISSING,
    converter: Callable[[Any], Any] | None = None,
    static: bool = False,
    shared: bool = False,
    **more: Any,
) -> Any:
    """Declares a field of a component; see `Quantity` for what can be said of it.

    A `static` one is part of the program: another value compiles anew. A `shared` one is, too, but
    in a batch it is a number that all lanes share (see `unfixed`).
    """
    declared = Quantity(unit, help, default, **more)
    static = static or shared
    given: dict[str, Any] = {"metadata": {"quantity": declared, SHARED: shared}, "static": static}
    if default is not MISSING:
        given["default"] = default
    if static and converter is None:
        converter = float if declared.kind is float else None
    if converter is not None:
        given["converter"] = converter
    return eqx.field(**given)


SHARED = "shared"
"""Marks a field's metadata; see `unfixed`."""


@functools.cache
def quantities(component: type[Component]) -> Mapping[str, Quantity]:
    """The declared parameters of a class of components, by the names of its fields."""
    return {
        f.name: replace(f.metadata["quantity"], name=f.name)
        for f in fields(component)
        if "quantity" in f.metadata
    }


@dataclass_transform(frozen_default=True, field_specifiers=(quantity, eqx.field))
class Component(eqx.Module):
    """A thing that describes itself: its fields are declared with `quantity`."""

    def __check_init__(self) -> None:
        declared = quantities(type(self))
        for name, what in declared.items():
            what.check(getattr(self, name))
        angles: dict[str, Any] = {}
        for name, what in declared.items():
            value = getattr(self, name)
            if what.unit == "angle" and what.count is None:
                angles[name] = value
            elif what.unit == "angle" and value is not None:
                angles |= {f"{name} of {what.each} {k}": v for k, v in enumerate(value, start=1)}
        check_radians(angles)

    def as_table(self) -> dict[str, Any]:
        """Its parameters by their names in study files; what is not set is left out, and what is
        true or false where it is as usual."""
        table: dict[str, Any] = {}
        for name, what in quantities(type(self)).items():
            value = getattr(self, name)
            if not what.key or (what.kind is bool and value == what.default):
                continue
            if value is not None:
                table[what.file_key] = what.to_file(value)
            elif what.word:
                table[what.key] = what.word
        return table

    def having(self, **changes: Any) -> Self:
        """The same thing with other parameters, which are checked."""
        return replace(self, **changes)

    def scaled(self, factor: float) -> Self:
        """The same thing with every length that many times as large."""
        lengths = [n for n, q in quantities(type(self)).items() if q.unit == "length"]
        return replace(
            self,
            **{n: jax.tree.map(lambda x: x * factor, getattr(self, n)) for n in lengths},
        )


C = TypeVar("C", bound=Component)


def usual_in(component: type[C], units: str) -> C:
    """A component of which everything is as usual where lengths are in `units`.

    Raises:
        ValueError: a parameter has to be given.
    """
    given: dict[str, Any] = {}
    for name, what in quantities(component).items():
        usual = what.default_in(units)
        if usual is MISSING:
            raise ValueError(what.why_missing(units))
        if usual is not what.default:
            given[name] = usual
    return component(**given)


M = TypeVar("M", bound=eqx.Module)
T = TypeVar("T", bound=type)


def unfixed(module: M) -> M:
    """The same module, with its `shared` parameters as leaves in place of parts of the program."""
    kind = _unfixed_kind(type(module))
    new = object.__new__(kind)
    for f in fields(module):
        value = getattr(module, f.name)
        object.__setattr__(new, f.name, unfixed(value) if isinstance(value, eqx.Module) else value)
    return cast(M, new)


@functools.cache
def _unfixed_kind(kind: type) -> type:
    named = [f for f in fields(kind) if f.metadata.get(SHARED)]
    if not named:
        return kind
    own = {f.name: eqx.field(default=None, metadata={SHARED: True}) for f in named}
    body = {"__annotations__": {f.name: float for f in named}, "__module__": kind.__module__, **own}
    return types.new_class(kind.__name__, (kind,), exec_body=lambda names: names.update(body))


def shared_leaves(tree: Any) -> Any:
    """The tree with True in place of what is `shared` by all lanes, and False elsewhere."""

    def is_shared(path: Sequence[Any], _: Any) -> bool:
        here, shared = tree, False
        for key in path:
            if isinstance(key, jax.tree_util.GetAttrKey):
                named = {f.name: f for f in fields(here)}
                shared = bool(named[key.name].metadata.get(SHARED))
                here = getattr(here, key.name)
            else:
                here = here[key.idx if isinstance(key, jax.tree_util.SequenceKey) else key.key]
        return shared

    return jax.tree_util.tree_map_with_path(is_shared, tree)


class Registry(Generic[C]):
    """The classes of one sort of components by their kind, as study files and flags name them.

    Arguments:
        noun: what they are, for messages.
        group: of entry points, through which installed packages add kinds.
        own: modules of this package that register some, imported when they are looked for.

    Examples:
        >>> from pcjax.model.bodies.base import BODIES
        >>> from pcjax.model.bodies.circle import Circle
        >>> BODIES["circle"] is Circle
        True
        >>> BODIES["crcle"]  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        ValueError: there is no body crcle: did you mean circle? there are circle, stick, ...
    """

    def __init__(self, noun: str, group: str, own: Sequence[str] = ()):
        self.noun, self.group, self._own = noun, group, own
        self._classes: dict[str, type[C]] = {}

    def register(self, kind: str) -> Callable[[T], T]:
        """A decorator that adds a class under a kind; a class of the same name replaces its own.

        Raises:
            ValueError: the kind is taken.
        """

        def add(component: T) -> T:
            other = self._classes.get(kind)
            if other is not None and other.__qualname__ != component.__qualname__:
                raise ValueError(f"the {self.noun} {kind} is taken, by {other.__qualname__}")
            self._classes[kind] = cast(type[C], component)
            return component

        return add

    def kinds(self) -> tuple[str, ...]:
        """All kinds: this package's, in the order in which it names their modules, then others."""
        self._import_own()
        places = {module: k for k, module in enumerate(self._own)}
        known = sorted(
            self._classes,
            key=lambda kind: places.get(self._classes[kind].__module__, len(places)),
        )
        return tuple(dict.fromkeys([*known, *(offer.name for offer in self._offered)]))

    def items(self) -> Iterator[tuple[str, type[C]]]:
        """All kinds with their classes, but for those of packages that cannot be imported: they
        are refused where they are asked for."""
        for kind in self.kinds():
            with suppress(ValueError):
                yield kind, self[kind]

    def __getitem__(self, kind: str) -> type[C]:
        """
        Raises:
            ValueError: there is no such kind, or the package that offers it cannot be imported.
        """
        self._import_own()
        if kind not in self._classes:
            for offer in self._offered:
                if offer.name == kind:
                    try:
                        self._classes.setdefault(kind, offer.load())
                    except Exception as error:
                        raise ValueError(
                            f"the {self.noun} {kind} cannot be loaded from {offer.value}: {error}"
                        ) from error
        if kind not in self._classes:
            hint = did_you_mean(kind, self.kinds())
            raise ValueError(
                f"there is no {self.noun} {kind}: {hint}there are {', '.join(self.kinds())}"
            )
        return self._classes[kind]

    def kind_of(self, thing: Any) -> str:
        """The kind of a component, or of a class of them.

        Raises:
            ValueError: its class is not registered.
        """
        wanted = thing if isinstance(thing, type) else type(thing)
        for kind, component in itertools.chain(tuple(self._classes.items()), self.items()):
            if component is wanted:
                return kind
        raise ValueError(
            f"the {self.noun} is a {wanted.__name__}, which no file can name: register the class, "
            f"with @register_{self.noun.replace(' ', '_')}('...')"
        )

    def _import_own(self) -> None:
        for module in self._own:
            importlib.import_module(module)

    @functools.cached_property
    def _offered(self) -> Sequence[EntryPoint]:
        # Looked for once: it means reading the metadata of every installed package.
        return tuple(entry_points(group=self.group))
