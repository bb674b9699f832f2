"""Many random problems for `time_path`, `bang_bang_time` and `torque_optimal_time`, checked without code of these planners.

No limit is exceeded, no feasible problem is refused, and every number is finite. `ARMLET_RANDOM_PATHS` is the number of paths,
`ARMLET_RANDOM_LINKS` that of one-link problems (`make test-paths CASES=`). Strata, counts and seed are printed. Paths run in
`ARMLET_RANDOM_JOBS` processes.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable

import friction_trials
import link_trials
import numpy as np
import path_trials
import pytest

import armlet as al

PATHS = int(os.environ.get("ARMLET_RANDOM_PATHS", "2000"))
LINKS = int(os.environ.get("ARMLET_RANDOM_LINKS", "10000"))
JOBS = int(os.environ.get("ARMLET_RANDOM_JOBS", "1"))
SEED = int(os.environ.get("ARMLET_RANDOM_SEED", "20220610"))
#: Largest number of failures that are printed.
SHOWN = 20


def path_block(number: int) -> tuple[str, int, path_trials.Verdict]:
    stratum = path_trials.STRATA[number % len(path_trials.STRATA)]
    return stratum, number, path_trials.trial(stratum, number, SEED)


def progress(done: int, total: int, failed: int, started: float) -> None:
    spent = time.monotonic() - started
    left = spent * (total - done) / max(done, 1)
    sys.stderr.write(f"  {done:,} of {total:,} in {spent:.0f} s, {failed} failed, {left:.0f} s to go\n")


@pytest.mark.slow
def test_random_paths(capsys: pytest.CaptureFixture[str]) -> None:
    blocks, started, said = max(len(path_trials.STRATA), PATHS // path_trials.SIZE), time.monotonic(), time.monotonic()
    counts, points, worst = Counter[str](), Counter[str](), dict.fromkeys(path_trials.STRATA, -1.0)
    failed: list[str] = []
    with multiprocessing.get_context("fork").Pool(JOBS) if JOBS > 1 else _Here() as pool, capsys.disabled():
        for stratum, number, verdict in pool.imap_unordered(path_block, range(blocks)):
            counts[stratum] += verdict.count
            points[stratum] += verdict.points
            worst[stratum] = max(worst[stratum], verdict.excess)
            failed.extend(f"{stratum}, block {number}, problem {i}: {what}" for i, what in verdict.failed)
            if time.monotonic() - said > 30.0:
                progress(counts.total(), blocks * path_trials.SIZE, len(failed), started)
                said = time.monotonic()
        print(f"\n  {counts.total():,} paths, seed {SEED}, {time.monotonic() - started:.0f} s:")
        for stratum in path_trials.STRATA:
            grid = points[stratum] / counts[stratum]
            print(
                f"    {stratum:10s} {counts[stratum]:>10,}, {grid:5.0f} grid points each, limits exceeded by {worst[stratum]:.1e} of them"
            )
    assert not failed, f"{len(failed)} of {counts.total()}: " + "; ".join(failed[:SHOWN])


class _Here:
    """A replacement for a pool that runs in this process."""

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @staticmethod
    def imap_unordered(function, items: Iterable[int]):  # type: ignore[no-untyped-def]
        return map(function, items)


@pytest.mark.slow
@pytest.mark.parametrize("stratum", link_trials.STRATA + friction_trials.STRATA)
def test_random_links(stratum: str, capsys: pytest.CaptureFixture[str]) -> None:
    # Problems with friction are solved and checked by integration. There are fewer of them, to save time.
    trials, each = (link_trials, LINKS // len(link_trials.STRATA)) if stratum in link_trials.STRATA else (friction_trials, LINKS // 50)
    started, tally, failed = time.monotonic(), Counter[str](), []
    for number in range(max(1, -(-each // trials.SIZE))):
        rng = np.random.default_rng([SEED, trials.STRATA.index(stratum), number])
        p = trials.problems(stratum, rng)
        for judge in trials.JUDGES:
            told, wrong = judge(p, rng)
            tally.update(told)
            failed.extend(f"block {number}, {what}: {p[i].tolist()}" for i, what in wrong)
    with capsys.disabled():
        told = ", ".join(f"{count:,} {name}" for name, count in sorted(tally.items()))
        print(f"\n  {each:,} links, {stratum}, seed {SEED}, {time.monotonic() - started:.0f} s: {told}")
    assert not failed, f"{len(failed)}: " + "; ".join(failed[:SHOWN])


#: Problems with difficult swings: the back-swing is very short, the turning angles are in narrow intervals, or the swing is slightly
#: faster than a monotone motion near a stall.
NARROW = [
    [-3.4667431832180107, -2.814124262858684, 10.577386720594172, -109865.70587046185, 94.14145400106368, -40246.14372858033],
    [-3.558150360695536, -3.5488716864023804, 0.005775910979976543, -17460853.818551697, 0.13954319545091431, -189229.8068359863],
    [3.7940024253092384, 3.1889730501039866, 0.12969317318958454, -12.865479324554553, 4.3428732318766485, -0.0340038955407953],
    [-3.5544469627077646, -1.8670087889617912, 1.075746488807721, -1.372440767604036, 0.5075716468143626, -1.146203133133958],
    [-1.3003522127171694, -1.3030002658054922, 0.013756859136407614, -8684.317004832841, 147.0599114151656, -77.68836774488192],
    [0.12424628602972376, 0.3534095478927082, 12.771673844943662, 19749.424561266478, 0.43940047905471336, -2815.410010692767],
    [1.4363807894175258, -1.4363937593490288, 417.2235890097754, 11832.543002486418, 1019450.6577567391, -0.017938928253700456],
    [-3.6224743829773054, -0.4390753926426507, 2.0, -1.0, 0.2736425197333957, -0.7950474343692491],
    [-0.4003039015544436, 3.5442195028763575, 2.0, -1.0, 0.64871455252122, -0.3995421934235476],
    [-2.941275316189179, -1.6583639235781948, 2.0, -1.0, 0.37411909922213027, -0.19548054529793712],
    [-0.7138730001349209, 2.9664840471715648, 2.0, 1.0, 0.2733896442176435, -0.8605441669811631],
    [2.8673611951638938, 2.712556207602659, 1.1833308755558893, -29612528.863405082, 944641.8731431491, -2512914.8678365764],
    [0.006615316172947416, 3.0456498074625395, 2.0, 1.0, 0.41756930786634927, -0.4280649993774789],
    [-3.24113400808573, 0.3843735078962238, 2.0, -1.0, 0.31337129327446495, -0.5962257394523759],
    [-0.28818667214519866, -3.266857315277945, 0.38710820855817285, -1.2938606261175016, 0.6231798409043563, -0.5283952859124622],
    [-0.5432625898620165, -3.0694215995714016, 0.3585356872269249, 1.461953996078945, 0.5338316421154022, -0.373781028113062],
    [3.555703924718502, 0.22597500739930965, 0.3404854084449527, 0.6977432299319695, 0.2163097449488981, -0.3301317484581173],
    [-0.326018048483494, 3.4965275765589174, 0.7568631125332195, 1.074166926167809, 0.10944631174480718, -0.8799570319348388],
    [0.891650242032866, -2.314944092851375, 0.3041162292327253, 0.8452421156257919, 1.0551041202788325, -0.34444018261225173],
]


def test_a_minimum_where_one_part_of_its_slope_changes_sign() -> None:
    row = [-3.677040130383208, 2.163386123318384, 0.5554822402005889, 1.0664540638360593, 0.21876016761475417]
    best = al.torque_optimal_time(*row).best
    beside = [al.torque_optimal_time(row[0] + shift, *row[1:]).best.t for shift in (-1e-3, 1e-3)]
    # T changes smoothly by 1e-3 s between the neighbouring problems.
    assert best.kind == "back-swing" and abs(best.t - np.mean(beside)) < 1e-5, (best, beside)


def test_rules_that_agree_by_chance() -> None:
    # A motion of two turns, for which two quadrature rules that are compared had the same error by chance.
    row = [5.599521593263056, 18.91548469442784, 1.3232613864949951, -0.18523837054913272, 1.688013602722488, -0.5040704951942897]
    tally, failed = link_trials.judge_optima(np.array([row]), np.random.default_rng(1))
    assert not failed and tally["monotone, checked"] == 1, (tally, failed)


def test_narrow_swings_are_found() -> None:
    tally, failed = link_trials.judge_optima(np.array(NARROW), np.random.default_rng(1))
    assert not failed and tally["none found"] == 0 and tally["back-swing"] + tally["overshoot"] == len(NARROW), (tally, failed)
