"""Maps scenes with known truth and tables the errors; see toolchain/accuracy.sh --help.

Reads the rasters itself: the figures do not rest on `leadline compare`. Standard library only.
"""

import argparse
import json
import math
import os
import pathlib
import random
import shutil
import subprocess
import sys

# rmse of the map over rmse of the best baseline, at most; from the product's requirements.
RATIO_BOUND = {
    "helens_low": 0.60, "helens_high": 0.72, "monterey_fan": 0.55, "helens_altimeter": 0.55,
    "helens_half_altitude": 0.80, "helens_rolling_fan": 0.95, "plane_flat": 0.70,
    "plane_slope30": 0.45,
}
COVERAGE_BOUND = 0.995
BIAS_BOUND_CELLS = 0.15
WITHIN_1_SIGMA = (0.58, 0.80)
WITHIN_2_SIGMA = (0.90, 0.99)
QUINTILE_WITHIN_1_SIGMA = (0.50, 0.85)
BASELINE_COVERAGE = 0.95
# Short false echoes: shares tried, and the scenes that they are put into.
OUTLIER_SHARES = (0.01, 0.05, 0.1, 0.3)
OUTLIER_PRESET = ("demo, 5 deg", ["--preset", "demo", "--set", "beam_half_angle_deg=5"])
OUTLIER_SCENES = ("helens_altimeter", "monterey_fan")
FALSE_SURFACE_CELLS = 2.0
# What OctoMap makes of a scene: built with the benches, absent without them.
OCTOMAP = "octomap_scene"


class Raster:
    """An ESRI ASCII grid: values in rows from the north, None where there is none."""

    def __init__(self, path):
        header = {}
        values = []
        with open(path, encoding="ascii") as stream:
            for line in stream:
                words = line.split()
                if words and words[0][0].isalpha() and words[0].lower() != "nan":
                    header[words[0].lower()] = float(words[1])
                else:
                    values.extend(words)
        self.columns = int(header["ncols"])
        self.rows = int(header["nrows"])
        self.cell_m = header["cellsize"]
        self.corner = (header["xllcorner"], header["yllcorner"])
        nodata = header.get("nodata_value", -9999.0)
        self.values = [None if float(v) == nodata else float(v) for v in values]
        if len(self.values) != self.columns * self.rows:
            raise ValueError(f"{path}: {len(self.values)} values for {self.columns} x {self.rows}")

    def same_geometry(self, other):
        return (self.columns, self.rows) == (other.columns, other.rows) and all(
            abs(a - b) < 1e-3 * self.cell_m
            for a, b in zip(self.corner + (self.cell_m,), other.corner + (other.cell_m,)))


class Errors:
    """Estimate minus truth over the cells that count, in cells; positive is shallow."""

    def __init__(self, estimate, truth, touched):
        if not (estimate.same_geometry(truth) and touched.same_geometry(truth)):
            raise ValueError("rasters of different geometry")
        self.cells = [i for i, t in enumerate(touched.values)
                      if t is not None and t > 0 and truth.values[i] is not None]
        known = [i for i in self.cells if estimate.values[i] is not None]
        self.known = known
        self.values = [(estimate.values[i] - truth.values[i]) / truth.cell_m for i in known]
        count = len(self.values)
        self.coverage = count / len(self.cells) if self.cells else 0.0
        self.bias = sum(self.values) / count if count else math.nan
        self.rmse = math.sqrt(sum(v * v for v in self.values) / count) if count else math.nan
        self.debiased = math.sqrt(max(0.0, self.rmse ** 2 - self.bias ** 2)) if count else math.nan


def calibration(errors, sigma, cell_m):
    """Shares within 1 and 2 sigma, and within 1 in each quintile of sigma."""
    pairs = sorted((sigma.values[i] / cell_m, abs(e)) for i, e in zip(errors.known, errors.values)
                   if sigma.values[i] is not None and sigma.values[i] > 0)
    if not pairs or len(pairs) != len(errors.known):
        return None
    within = [sum(e <= k * s for s, e in pairs) / len(pairs) for k in (1, 2)]
    quintiles = []
    for q in range(5):
        part = pairs[q * len(pairs) // 5:(q + 1) * len(pairs) // 5]
        quintiles.append(sum(e <= s for s, e in part) / len(part))
    return {"within_1": within[0], "within_2": within[1], "quintiles": quintiles,
            "sigma_min": pairs[0][0], "sigma_max": pairs[-1][0]}


def run(command):
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                            timeout=1800, check=False)
    if result.returncode != 0:
        sys.stderr.write(result.stdout + result.stderr)
        raise SystemExit(f"accuracy: {command[0]} {command[1]} ended with {result.returncode}")


def best_octomap(folder, truth, touched):
    """The best of the ways to read OctoMap: by rmse where coverage allows, else by coverage."""
    found = {file.stem: Errors(Raster(file), truth, touched) for file in folder.glob("*.asc")}
    name = min(found, key=lambda n: (
        (0, found[n].rmse) if found[n].coverage >= BASELINE_COVERAGE else (1, -found[n].coverage)))
    return {"octomap_rmse": found[name].rmse, "octomap_coverage": found[name].coverage,
            "octomap_way": name}


def measure(scene, build, out):
    """All figures of one scene folder."""
    leadline = build / "host_tools" / "leadline"
    inputs = ["--pings", scene / "pings.csv", "--config", scene / "map.toml"]
    out.mkdir(parents=True, exist_ok=True)
    truth = Raster(scene / "truth.asc")
    touched = Raster(scene / "touched.asc")

    run([leadline, "map", *inputs, "--out", out / "map"])
    run([leadline, "grid", *inputs, "--out", out / "grid"])
    baselines = {file.stem: Errors(Raster(file), truth, touched)
                 for file in sorted((out / "grid").glob("*.asc"))}
    eligible = {name: e for name, e in baselines.items()
                if name.startswith(("gaussian", "median")) and e.coverage >= BASELINE_COVERAGE}
    if not eligible:
        raise SystemExit(f"accuracy: {scene.name}: no baseline covers 95 %")
    best = min(eligible, key=lambda name: eligible[name].rmse)
    best_debiased = min(e.debiased for e in eligible.values())

    ours = Errors(Raster(out / "map" / "depth.asc"), truth, touched)
    stats = json.loads((out / "map" / "stats.json").read_text())
    figures = {
        "scene": scene.name,
        "best_baseline": best,
        "baseline_rmse": eligible[best].rmse,
        "baseline_debiased": eligible[best].debiased,
        "lowest_debiased": best_debiased,
        "rmse": ours.rmse,
        "bias": ours.bias,
        "coverage": ours.coverage,
        "ratio": ours.rmse / eligible[best].rmse,
        "ratio_debiased": ours.rmse / eligible[best].debiased,
        "sigma": calibration(ours, Raster(out / "map" / "sigma.asc"), truth.cell_m),
        "integrate_seconds": stats.get("integrate_seconds"),
        "pings": stats.get("pings"),
        "map_hash": stats.get("map_hash"),
        "octomap_rmse": None,
    }
    octomap = build / "tests" / OCTOMAP
    if octomap.exists():
        run([octomap, *inputs, "--out", out / "octomap"])
        figures.update(best_octomap(out / "octomap", truth, touched))
    figures["broken_depth"] = broken_depth(figures)
    figures["broken_sigma"] = broken_sigma(figures["sigma"])
    figures["broken"] = figures["broken_depth"] + figures["broken_sigma"]
    return figures


def broken_depth(f):
    broken = []
    bound = RATIO_BOUND.get(f["scene"])
    if bound is not None and not f["ratio"] <= bound:
        broken.append(f"ratio {f['ratio']:.3f} > {bound}")
    if not f["coverage"] >= COVERAGE_BOUND:
        broken.append(f"coverage {f['coverage']:.4f} < {COVERAGE_BOUND}")
    if not abs(f["bias"]) <= BIAS_BOUND_CELLS:
        broken.append(f"bias {f['bias']:+.3f} beyond {BIAS_BOUND_CELLS}")
    return broken


def broken_sigma(sigma):
    if sigma is None:
        return ["cells without sigma"]
    broken = []
    checks = [("within 1 sigma", sigma["within_1"], WITHIN_1_SIGMA),
              ("within 2 sigma", sigma["within_2"], WITHIN_2_SIGMA)]
    checks += [(f"within 1 sigma, quintile {i + 1}", share, QUINTILE_WITHIN_1_SIGMA)
               for i, share in enumerate(sigma["quintiles"])]
    broken += [f"{name}: {share:.3f} not in {low}..{high}"
               for name, share, (low, high) in checks if not low <= share <= high]
    if not sigma["sigma_max"] > sigma["sigma_min"]:
        broken.append("sigma is a constant")
    return broken


def number(value, form="{:.3f}"):
    return "-" if value is None else form.format(value)


def verdict(broken):
    return "**no**" if broken else "yes"


def share_range(bounds):
    return f"{100 * bounds[0]:g}-{100 * bounds[1]:g} %"


def octomap_text(f):
    if f["octomap_rmse"] is None:
        return "-"
    return f"{f['octomap_rmse']:.3f} ({f['octomap_way']}, {100 * f['octomap_coverage']:.0f} %)"


def print_tables(all_figures):
    print("\nErrors in cells over the touched cells, positive is shallow; ratio: rmse / rmse of the best "
          "baseline.\n")
    print("| scene | best baseline | rmse | debiased | OctoMap | ours | bias | coverage | ratio |"
          " bound | / debiased | holds |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for f in all_figures:
        print(f"| {f['scene']} | {f['best_baseline']} | {f['baseline_rmse']:.3f} "
              f"| {f['baseline_debiased']:.3f} | {octomap_text(f)} | {f['rmse']:.3f} "
              f"| {f['bias']:+.3f} | {100 * f['coverage']:.2f} % | {f['ratio']:.3f} "
              f"| {number(RATIO_BOUND.get(f['scene']), '{:.2f}')} | {f['ratio_debiased']:.3f} "
              f"| {verdict(f['broken_depth'])} |")
    print(f"\nBounds of all scenes: |bias| <= {BIAS_BOUND_CELLS}, coverage >= {100 * COVERAGE_BOUND:g} %.")
    print("\nCalibration: share of cells within 1 and 2 sigma, and within 1 by quintile of sigma. Bounds: "
          f"{share_range(WITHIN_1_SIGMA)}, {share_range(WITHIN_2_SIGMA)}, each quintile "
          f"{share_range(QUINTILE_WITHIN_1_SIGMA)}.\n")
    print("| scene | 1 sigma | 2 sigma | q1 | q2 | q3 | q4 | q5 | sigma, cells | holds | pings/s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for f in all_figures:
        s = f["sigma"]
        rate = None
        if f["pings"] and f["integrate_seconds"]:
            rate = f["pings"] / f["integrate_seconds"]
        if s is None:
            print(f"| {f['scene']} | cells without sigma |  |  |  |  |  |  |  | **no** "
                  f"| {number(rate, '{:.0f}')} |")
            continue
        quintiles = " | ".join(f"{100 * q:.0f} %" for q in s["quintiles"])
        print(f"| {f['scene']} | {100 * s['within_1']:.1f} % | {100 * s['within_2']:.1f} % "
              f"| {quintiles} | {s['sigma_min']:.2f} .. {s['sigma_max']:.2f} "
              f"| {verdict(f['broken_sigma'])} | {number(rate, '{:.0f}')} |")
    mean = math.exp(sum(math.log(f["ratio_debiased"]) for f in all_figures) / len(all_figures))
    print(f"\nGeometric mean of ours / debiased best baseline over {len(all_figures)} scenes: "
          f"{mean:.3f} (bound: below 1)")
    return mean


# Rule and gain, as in [model]; None: the default configuration.
RULES = [("log_odds", None), ("weighted_mean", None), ("certainty_factor", 0.1),
         ("certainty_factor", 0.5), ("recursive", 0.05), ("recursive", 0.2), ("recursive", 0.5)]


def compare_rules(scenes, names, build, out):
    """Table of scene x rule: rmse and bias in cells."""
    print("\nrmse (bias) in cells by rule and k_p, everything else as above.\n")
    titles = [rule + (f" {gain:g}" if gain else "") for rule, gain in RULES]
    print("| scene | " + " | ".join(titles) + " |")
    print("|---" * (len(titles) + 1) + "|")
    for name in names:
        scene = scenes / name
        truth = Raster(scene / "truth.asc")
        touched = Raster(scene / "touched.asc")
        cells = []
        for (rule, gain), title in zip(RULES, titles):
            folder = out / name / "rules" / title.replace(" ", "-")
            folder.mkdir(parents=True, exist_ok=True)
            config = (scene / "map.toml").read_text()
            if "[model]" in config:
                raise SystemExit(f"accuracy: {scene}: map.toml has a [model] of its own")
            config += f'\n[model]\nrule = "{rule}"\n' + (f"k_p = {gain}\n" if gain else "")
            (folder / "map.toml").write_text(config)
            run([build / "host_tools" / "leadline", "map", "--pings", scene / "pings.csv",
                 "--config", folder / "map.toml", "--out", folder / "map"])
            errors = Errors(Raster(folder / "map" / "depth.asc"), truth, touched)
            cells.append(f"{errors.rmse:.3f} ({errors.bias:+.3f})")
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def add_outliers(scene, share, folder):
    """A copy of a scene in which a share of the ranges is replaced by one uniformly short of it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("map.toml", "truth.asc", "touched.asc"):
        shutil.copyfile(scene / name, folder / name)
    choice = random.Random(7)
    with open(scene / "pings.csv", encoding="ascii") as source, \
            open(folder / "pings.csv", "w", encoding="ascii") as out:
        header = source.readline()
        out.write(header)
        at = header.strip().split(",").index("range_m")
        for line in source:
            words = line.rstrip("\n").split(",")
            false, short = choice.random() < share, choice.random()
            if false and words[at]:
                words[at] = f"{max(0.05, short * float(words[at])):.4f}"
            out.write(",".join(words) + "\n")


def false_share(errors):
    """Share of columns whose surface stands clearly above the truth."""
    return sum(e > FALSE_SURFACE_CELLS for e in errors.values) / max(1, len(errors.values))


def outlier_figures(scene, build, out):
    leadline = build / "host_tools" / "leadline"
    inputs = ["--pings", scene / "pings.csv", "--config", scene / "map.toml"]
    truth = Raster(scene / "truth.asc")
    touched = Raster(scene / "touched.asc")
    run([leadline, "map", *inputs, "--out", out / "map"])
    run([leadline, "grid", *inputs, "--out", out / "grid"])
    found = {file.stem: Errors(Raster(file), truth, touched)
             for file in sorted((out / "grid").glob("*.asc"))}
    found = {name: e for name, e in found.items()
             if name.startswith(("gaussian", "median")) and e.coverage >= BASELINE_COVERAGE}
    medians = [name for name in found if name.startswith("median")]
    best = min(found, key=lambda name: found[name].rmse)
    median = min(medians, key=lambda name: found[name].rmse) if medians else None
    figures = {"ours": Errors(Raster(out / "map" / "depth.asc"), truth, touched), "best": best,
               "best_errors": found[best], "median": median,
               "median_errors": found.get(median), "octomap": None}
    octomap = build / "tests" / OCTOMAP
    if octomap.exists():
        run([octomap, *inputs, "--out", out / "octomap"])
        # The highest occupied voxel of each column, as a planner would see it.
        ways = {file.stem: Errors(Raster(file), truth, touched)
                for file in (out / "octomap").glob("*-top.asc")}
        way = min(ways, key=lambda n: ways[n].rmse)
        figures["octomap"], figures["octomap_errors"] = way, ways[way]
    return figures


def compare_outliers(scenes, build, out):
    """Table over scenes and shares of false echoes; returns what is out of bounds."""
    print("\nShort false echoes: a share of the ranges replaced by one uniformly short of it. rmse (bias) in "
          f"cells; false: columns whose surface stands over {FALSE_SURFACE_CELLS:g} cells too high.\n")
    print("| scene | share | ours | false | best gridding | false | best median | OctoMap, top | false |")
    print("|---" * 9 + "|")
    broken = []
    sources = [OUTLIER_PRESET[0]] + [name for name in OUTLIER_SCENES if (scenes / name).is_dir()]
    for name in sources:
        for share in OUTLIER_SHARES:
            folder = out / "outliers" / f"{name.split(',')[0]}-{share:g}"
            folder.mkdir(parents=True, exist_ok=True)
            if name == OUTLIER_PRESET[0]:
                run([build / "host_tools" / "leadline", "scene", *OUTLIER_PRESET[1], "--set",
                     f"outlier_fraction={share:g}", "--out", folder])
            else:
                add_outliers(scenes / name, share, folder)
            f = outlier_figures(folder, build, folder)

            def text(e):
                return "- |" if e is None else f"{e.rmse:.3f} ({e.bias:+.2f}) | {100 * false_share(e):.2f} %"
            median = f["median_errors"]
            middle = "-" if median is None else f"{median.rmse:.3f} ({f['median']})"
            print(f"| {name} | {100 * share:g} % | {text(f['ours'])} "
                  f"| {f['best']}: {text(f['best_errors'])} | {middle} "
                  f"| {text(f.get('octomap_errors'))} |", flush=True)
            if not f["ours"].rmse < f["best_errors"].rmse:
                broken.append(f"{name} with {100 * share:g} % false echoes: rmse {f['ours'].rmse:.3f}, "
                              f"best gridding {f['best_errors'].rmse:.3f}")
    return broken


def report(broken):
    print()
    for text in broken:
        print(f"out of bounds: {text}")
    if not broken:
        print("every bound holds")
    return 1 if broken else 0


def main():
    parser = argparse.ArgumentParser(prog="accuracy.sh", add_help=False)
    parser.add_argument("--root", type=pathlib.Path, required=True)
    parser.add_argument("--scenes", type=pathlib.Path)
    parser.add_argument("--build", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--rules", action="store_true")
    parser.add_argument("--outliers", action="store_true")
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()

    data = pathlib.Path(os.environ.get("LEADLINE_DATA") or arguments.root / ".." / "shared" / "data")
    scenes = arguments.scenes or data / "scenes"
    if not scenes.is_dir():
        print(f"*skipped*: {scenes} is not there (--scenes or LEADLINE_DATA names another folder)")
        return 77
    names = arguments.names or sorted(p.parent.name for p in scenes.glob("*/pings.csv"))
    if not names:
        print(f"accuracy: no scene in {scenes}", file=sys.stderr)
        return 2
    missing = [name for name in names if not (scenes / name / "pings.csv").is_file()]
    if missing:
        print(f"accuracy: no such scene: {', '.join(missing)}", file=sys.stderr)
        return 2
    build = arguments.build or arguments.root / "build" / "release"
    out = arguments.out or arguments.root / "out" / "accuracy"

    if arguments.rules:
        compare_rules(scenes, names, build, out)
        return 0
    if arguments.outliers:
        return report(compare_outliers(scenes, build, out))
    all_figures = []
    for name in names:
        print(f"{name} ...", file=sys.stderr, flush=True)
        all_figures.append(measure(scenes / name, build, out / name))
    mean = print_tables(all_figures)
    (out / "accuracy.json").write_text(json.dumps(all_figures, indent=1) + "\n")

    broken = [f"{f['scene']}: {text}" for f in all_figures for text in f["broken"]]
    # Stated for the eight scenes together.
    if set(RATIO_BOUND) <= {f["scene"] for f in all_figures} and not mean < 1.0:
        broken.append(f"geometric mean against the debiased baseline {mean:.3f} is not below 1")
    if not arguments.names:
        broken += compare_outliers(scenes, build, out)
    return report(broken)


if __name__ == "__main__":
    sys.exit(main())
