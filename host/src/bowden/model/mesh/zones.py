"""One cable of the mesh: its two moving zones, how they answer, grow, meet, stop and go slack.

Compiled helpers over the `Tables` and `State` of `mesh.state`; `mesh.events` drives them.

From each end e a zone of ``depth`` segments slides; between the zones the cable is at standstill.
At both ends the same words hold, seen from the end: its outward displacement pulls (PULL) or pays
out (RELEASE). When the depths add up to N no segment is at standstill: with opposite motions the
cable moves as a whole, with equal ones it parts at a neutral node.
"""

# ruff: noqa: PLR0917  (kernels take their state apart; numba has no keyword-only)

from __future__ import annotations

from bowden.model.compiled import compiled_in_place
from bowden.model.mesh.state import PULL, RELEASE, State, Tables

NOTHING, SLIDE, KINK, GOES_SLACK, GOES_TAUT = 0, 1, 2, 3, 4
SURE = 1e-12


@compiled_in_place
def node_at(segments: int, end: int, n: int) -> int:
    """Node number n counted from an end, as counted from the motor."""
    return n if end == 0 else segments - n


@compiled_in_place
def is_virgin(s: State, segments: int, cable: int, end: int, n: int) -> bool:
    """Return whether segment n from an end has never slid."""
    j = n if end == 0 else segments - 1 - n
    return bool(s.virgin[cable, 0] <= j < s.virgin[cable, 1])


@compiled_in_place
def slides_whole(t: Tables, s: State, cable: int) -> bool:
    """Return whether no segment is at standstill."""
    return bool(s.depth[cable, 0] + s.depth[cable, 1] == t.half.shape[1])


@compiled_in_place
def front_half(t: Tables, s: State, cable: int, end: int) -> float:
    """Compliance of the half of the resting segment that stretches with the zone, m/N."""
    d = s.depth[cable, end]
    if not is_virgin(s, t.half.shape[1], cable, end, d):
        return float(t.half[end, d])
    motion = s.motion[cable, end]
    tension = s.end_n[cable, end] * t.decay[cable, end, motion, d]
    side = motion
    if tension > t.pretension_n * (1 + SURE):
        side = PULL
    elif tension < t.pretension_n * (1 - SURE):
        side = RELEASE
    return float(t.half_virgin[end, side, d])


@compiled_in_place
def other_over_this(t: Tables, s: State, cable: int, end: int) -> float:
    """Tension at the other end over that at this one, while the whole cable slides."""
    far = 1 - end
    return float(
        t.decay[cable, end, s.motion[cable, end], s.depth[cable, end]]
        / t.decay[cable, far, s.motion[cable, far], s.depth[cable, far]]
    )


@compiled_in_place
def stiffness(t: Tables, s: State, cable: int, end: int) -> float:
    """Tension that an end gains per metre of its own outward displacement, N/m; 0 if slack.

    While the whole cable slides, the other end's outward displacement counts the same.
    """
    if s.gap_m[cable] >= 0:
        return 0.0
    d, motion = s.depth[cable, end], s.motion[cable, end]
    outer = t.outer[cable, end, motion, d]
    if slides_whole(t, s, cable):
        far = 1 - end
        other = t.outer[cable, far, s.motion[cable, far], s.depth[cable, far]]
        return float(1.0 / (outer + other * other_over_this(t, s, cable, end)))
    return float(1.0 / (outer + front_half(t, s, cable, end) * t.decay[cable, end, motion, d]))


@compiled_in_place
def respond(t: Tables, s: State) -> None:
    """Work out the stiffness of all ends for the zones as they are."""
    for cable in range(2):
        for end in range(2):
            s.stiffness_n_per_m[cable, end] = stiffness(t, s, cable, end)


@compiled_in_place
def rate(t: Tables, s: State, cable: int, end: int, pull_0: float, pull_1: float) -> float:
    """Change of the end's tension for given outward displacements of both ends, N."""
    if slides_whole(t, s, cable):
        return float(s.stiffness_n_per_m[cable, end] * (pull_0 + pull_1))
    return float(s.stiffness_n_per_m[cable, end] * (pull_0 if end == 0 else pull_1))


@compiled_in_place
def free_motion(t: Tables, s: State, free: int, force: float, spring: float, other: float) -> float:
    """Displacement of the free pulley that adds `force` to its difference of tensions, m.

    Both cables slack: 0.
    """
    total, coupled = spring, 0.0
    for cable in range(2):
        k = s.stiffness_n_per_m[cable, free]
        total += k
        if s.gap_m[cable] < 0 and slides_whole(t, s, cable):
            coupled += k
    return float((force - coupled * other) / total) if total > 0 else 0.0


@compiled_in_place
def freeze(t: Tables, s: State, cable: int, end: int) -> None:
    """Write the zone's tensions down and start again at its end: the profile is the memory."""
    motion, segments = s.motion[cable, end], t.half.shape[1]
    for n in range(s.depth[cable, end] + 1):
        s.node_n[cable, node_at(segments, end, n)] = (
            s.end_n[cable, end] * t.decay[cable, end, motion, n]
        )
    s.depth[cable, end] = 0


@compiled_in_place
def turn(t: Tables, s: State, cable: int, end: int) -> None:
    """Reverse the motion of an end. Of a cable in mass motion the other zone keeps the whole."""
    far = 1 - end
    if slides_whole(t, s, cable) and s.motion[cable, 0] != s.motion[cable, 1]:
        s.depth[cable, end] = 0
        s.depth[cable, far] = t.half.shape[1]
    else:
        freeze(t, s, cable, end)
    s.motion[cable, end] = 1 - s.motion[cable, end]


@compiled_in_place
def stop_backward(t: Tables, s: State, cable: int, pull_0: float, pull_1: float) -> bool:
    """Stop a segment beside a neutral node that would slide backwards; True if there was one.

    One without friction changes sides instead.
    """
    if s.gap_m[cable] >= 0 or not slides_whole(t, s, cable):
        return False
    if s.motion[cable, 0] != s.motion[cable, 1]:
        return False
    for end in range(2):
        d, motion = s.depth[cable, end], s.motion[cable, end]
        if d > 0:
            within = t.outer[cable, end, motion, d - 1]
            within += t.half[end, d - 1] * t.decay[cable, end, motion, d - 1]
            pull = pull_0 if end == 0 else pull_1
            slip = pull - rate(t, s, cable, end, pull_0, pull_1) * within
            if slip * (2 * motion - 1) < -SURE * (abs(pull_0) + abs(pull_1)):
                s.depth[cable, end] = d - 1
                if t.hold[cable, end, motion, d - 1] == 1:
                    s.depth[cable, 1 - end] += 1
                return True
    return False


@compiled_in_place
def turn_with_ends(t: Tables, s: State, cable: int, pull_0: float, pull_1: float) -> bool:
    """Turn the zones whose end moves against them; True if there was one."""
    if s.gap_m[cable] >= 0:
        return False
    turned = False
    for end in range(2):
        pull = pull_0 if end == 0 else pull_1
        if pull * (2 * s.motion[cable, end] - 1) < 0:
            turn(t, s, cable, end)
            turned = True
    return turned


@compiled_in_place
def next_event(
    t: Tables, s: State, cable: int, pull_0: float, pull_1: float
) -> tuple[float, int, int]:
    """Find what happens first on the way: (fraction of the way, what, at which end)."""
    first, what, where = 1.0, NOTHING, 0
    segments = t.half.shape[1]
    # A cable that just follows, its ends moving alike, shall not flicker between slack and taut.
    stretch, sure = pull_0 + pull_1, SURE * (abs(pull_0) + abs(pull_1))
    if s.gap_m[cable] >= 0:
        if stretch > sure and s.gap_m[cable] < stretch:
            return s.gap_m[cable] / stretch, GOES_TAUT, 0
        return first, what, where
    if slides_whole(t, s, cable):
        change = rate(t, s, cable, 0, pull_0, pull_1)
        if stretch < -sure and s.end_n[cable, 0] + change <= 0:
            return s.end_n[cable, 0] / -change, GOES_SLACK, 0
        return first, what, where

    shared = s.depth[cable, 0] + s.depth[cable, 1] == segments - 1
    for end in range(2):
        far = 1 - end
        d, motion = s.depth[cable, end], s.motion[cable, end]
        sign = 2.0 * motion - 1.0
        fall = t.decay[cable, end, motion, d]
        change = rate(t, s, cable, end, pull_0, pull_1) * fall
        tension = s.end_n[cable, end] * fall
        if shared:
            fall = t.decay[cable, far, s.motion[cable, far], s.depth[cable, far]]
            inner = s.end_n[cable, far] * fall
            inner_change = rate(t, s, cable, far, pull_0, pull_1) * fall
        else:
            inner = s.node_n[cable, node_at(segments, end, d + 1)]
            inner_change = 0.0
        hold = t.hold[cable, end, motion, d]
        hold = hold if motion == PULL else 1.0 / hold
        missing = sign * (inner * hold - tension)
        closing = sign * (change - inner_change * hold)
        if missing < -SURE * tension or (missing <= 0 and closing > 0):
            return 0.0, SLIDE, end
        if closing > 0 and missing < closing * first:
            first, what, where = missing / closing, SLIDE, end
        if change != 0 and is_virgin(s, segments, cable, end, d):
            to_kink = (t.pretension_n - tension) / change
            if 0 < to_kink < first and abs(t.pretension_n - tension) > SURE * tension:
                first, what, where = to_kink, KINK, end
        if stretch < -sure and tension + change * first < 0:  # both alike: none of it slides
            first, what, where = tension / -change, GOES_SLACK, end
    return first, what, where


@compiled_in_place
def advance(t: Tables, s: State, cable: int, pull_0: float, pull_1: float, fraction: float) -> None:
    """Move the ends by a fraction of their displacements, no event in between."""
    if s.gap_m[cable] >= 0:
        s.gap_m[cable] = max(s.gap_m[cable] - fraction * (pull_0 + pull_1), 0.0)
        return
    change_0 = fraction * rate(t, s, cable, 0, pull_0, pull_1)
    change_1 = fraction * rate(t, s, cable, 1, pull_0, pull_1)
    s.end_n[cable, 0] = max(s.end_n[cable, 0] + change_0, 0.0)
    if slides_whole(t, s, cable):
        s.end_n[cable, 1] = s.end_n[cable, 0] * other_over_this(t, s, cable, 0)
    else:
        s.end_n[cable, 1] = max(s.end_n[cable, 1] + change_1, 0.0)


@compiled_in_place
def half_stretch(t: Tables, s: State, cable: int, end: int, n: int, tension: float) -> float:
    """Stretch of one half of segment n from an end, under the tension of its node, m."""
    if not is_virgin(s, t.half.shape[1], cable, end, n):
        return float(t.half[end, n] * tension)
    side = PULL if tension > t.pretension_n else RELEASE
    rest = 0.5 * t.pretension_n * (t.half_virgin[end, PULL, n] + t.half_virgin[end, RELEASE, n])
    return float(rest + t.half_virgin[end, side, n] * (tension - t.pretension_n))


@compiled_in_place
def tension_for(t: Tables, s: State, cable: int, end: int, stretch: float) -> float:
    """Return the tension of an end at which its zone has a stretch, N; not less than 0.

    With the half of the segment at its front, which has a kink at the pretension until it slides.
    """
    d, motion = s.depth[cable, end], s.motion[cable, end]
    fall, outer = t.decay[cable, end, motion, d], t.outer[cable, end, motion, d]
    if not is_virgin(s, t.half.shape[1], cable, end, d):
        return float(max(stretch / (outer + t.half[end, d] * fall), 0.0))
    kink = t.pretension_n / fall
    over = stretch - outer * kink - half_stretch(t, s, cable, end, d, t.pretension_n)
    half = t.half_virgin[end, PULL if over > 0 else RELEASE, d]
    return float(max(kink + over / (outer + half * fall), 0.0))


@compiled_in_place
def is_overloaded(t: Tables, s: State, cable: int, end: int) -> bool:
    """Return whether the segment at the front of a zone bears more than it does sliding."""
    segments, far = t.half.shape[1], 1 - end
    d, motion = s.depth[cable, end], s.motion[cable, end]
    if d + s.depth[cable, far] == segments - 1:
        inner = s.end_n[cable, far]
        inner *= t.decay[cable, far, s.motion[cable, far], s.depth[cable, far]]
    else:
        inner = s.node_n[cable, node_at(segments, end, d + 1)]
    near = s.end_n[cable, end] * t.decay[cable, end, motion, d]
    borne = s.end_n[cable, end] * t.decay[cable, end, motion, d + 1]
    return bool((2 * motion - 1) * (borne - inner) > SURE * near)


@compiled_in_place
def slide(t: Tables, s: State, cable: int, end: int) -> None:
    """Let the segment at the front of a zone slide; one that bears more than so drops it at once.

    The segments at standstill and the ends keep their places, so the stretch between them is the
    same before and after.
    """
    segments, far = t.half.shape[1], 1 - end
    d, motion = s.depth[cable, end], s.motion[cable, end]
    # Paid out from both ends, stick and slip would follow each other ever faster, without end, as
    # the tension vanishes. Straight pieces bear more where a segment beside them has held.
    drops = (t.sticks or t.varies) and s.end_n[cable, end] > t.least_n
    drops = drops and is_overloaded(t, s, cable, end)
    shared = d + s.depth[cable, far] == segments - 1
    if drops and shared and s.motion[cable, far] == motion and s.depth[cable, far] > 0:
        # The drop would drag the other zone's first segment backwards: it stops.
        k = s.depth[cable, far]
        s.node_n[cable, node_at(segments, far, k)] = (
            s.end_n[cable, far] * t.decay[cable, far, motion, k]
        )
        s.depth[cable, far] = k - 1
        shared = False
    if drops:
        near = s.end_n[cable, end] * t.decay[cable, end, motion, d]
        stretch = s.end_n[cable, end] * t.outer[cable, end, motion, d]
        stretch += half_stretch(t, s, cable, end, d, near)
        if shared:
            m, k = s.motion[cable, far], s.depth[cable, far]
            inner = s.end_n[cable, far] * t.decay[cable, far, m, k]
            stretch += half_stretch(t, s, cable, end, d, inner)
            stretch += s.end_n[cable, far] * t.outer[cable, far, m, k]
        else:
            inner = s.node_n[cable, node_at(segments, end, d + 1)]
            stretch += half_stretch(t, s, cable, end, d, inner)
            stretch += half_stretch(t, s, cable, end, d + 1, inner)

    s.depth[cable, end] = d + 1
    if end == 0:
        s.virgin[cable, 0] = max(s.virgin[cable, 0], d + 1)
    else:
        s.virgin[cable, 1] = min(s.virgin[cable, 1], segments - d - 1)

    if drops and shared:
        s.end_n[cable, end] = stretch * stiffness(t, s, cable, end)
    elif drops:
        s.end_n[cable, end] = tension_for(t, s, cable, end, stretch)
    if shared:
        s.end_n[cable, far] = s.end_n[cable, end] * other_over_this(t, s, cable, end)


@compiled_in_place
def make_taut(t: Tables, s: State, cable: int, pull_0: float, pull_1: float) -> None:
    """Let a slack cable carry again: from zero tension everywhere, all of it sliding."""
    s.gap_m[cable] = -1.0
    s.end_n[cable, :] = 0.0
    s.motion[cable, 0] = PULL if pull_0 > 0 else RELEASE
    s.motion[cable, 1] = PULL if pull_1 > 0 else RELEASE
    s.depth[cable, 0] = t.half.shape[1]
    s.depth[cable, 1] = 0
    s.virgin[cable, :] = 0


@compiled_in_place
def make_slack(s: State, cable: int) -> None:
    """Take a cable out: no tension anywhere."""
    s.gap_m[cable] = 0.0
    s.end_n[cable, :] = 0.0
    s.node_n[cable, :] = 0.0
