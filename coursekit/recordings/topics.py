"""Which of a bag's topics is the odometry, which the scan: by type and usual name, or as somebody says."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from coursekit.recordings.ros_rows import KINDS

_TRUTH = re.compile(r"truth|mocap|vicon|vrpn|qualisys|optitrack|motive|(^|[/_])gt([/_]|$)", re.IGNORECASE)


def choose_topics(
    known: Mapping[str, str],
    topics: Mapping[str, str] | Iterable[str] | None,
    path: str | Path,
) -> tuple[dict[str, list[str]], Counter[str]]:
    """Kind → its topics, and what was left out because nobody said which of several was meant."""
    if topics is not None:
        return _asked(known, topics, path), Counter()
    chosen: dict[str, list[str]] = {}
    left_out: Counter[str] = Counter()
    for kind in KINDS:
        fitting = [t for t, msgtype in known.items() if msgtype in KINDS[kind].types and _plausible(kind, t)]
        usual = [topic for topic in fitting if re.search(KINDS[kind].preferred, topic)]
        candidates = fitting if kind == "tf" or len(fitting) == 1 else usual if len(usual) == 1 else []
        if candidates:
            chosen[kind] = candidates
        elif fitting and kind == "odometry":
            raise ValueError(f"{path}: which is the odometry, {' or '.join(fitting)}?  Say topics={{'odometry': …}}")
        elif fitting:
            left_out[f"{kind}: could be any of {', '.join(fitting)}; name one in topics"] += len(fitting)
    return chosen, left_out


def _plausible(kind: str, topic: str) -> bool:
    """Odometry and truth have the same types; only their names tell them apart."""
    return {"truth": bool(_TRUTH.search(topic)), "odometry": not _TRUTH.search(topic)}.get(kind, True)


def _asked(
    known: Mapping[str, str], topics: Mapping[str, str] | Iterable[str], path: str | Path
) -> dict[str, list[str]]:
    if isinstance(topics, str) or (isinstance(topics, Mapping) and (strange := [k for k in topics if k not in KINDS])):
        got = topics if isinstance(topics, str) else ", ".join(map(repr, strange))
        raise ValueError(f"topics: expected kinds among {', '.join(KINDS)}, each with its topic, got {got}")
    pairs = list(topics.items()) if isinstance(topics, Mapping) else [("", topic) for topic in topics]
    chosen: dict[str, list[str]] = {}
    for kind, name in pairs:
        topic = name if name in known else f"/{name}"
        if topic not in known:
            listed = ", ".join(f"{t} ({msgtype})" for t, msgtype in sorted(known.items()))
            raise ValueError(f"{path}: there is no topic {name!r}; the bag has {listed or 'none'}")
        fitting = [k for k in KINDS if known[topic] in KINDS[k].types and (kind or _plausible(k, topic))]
        if (kind or (fitting or ["nothing"])[0]) not in fitting:
            wanted = " or ".join(KINDS[kind].types) if kind else "a type that is read"
            raise ValueError(f"{path}: {topic} has the type {known[topic]}, expected {wanted}")
        chosen.setdefault(kind or fitting[0], []).append(topic)
    if doubles := [f"{kind}: {', '.join(names)}" for kind, names in chosen.items() if len(names) > 1 and kind != "tf"]:
        raise ValueError(f"topics: expected one topic a kind, got {doubles[0]}")
    return chosen
