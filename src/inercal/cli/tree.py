"""The tree of commands: what each does, an example, and the module that is loaded when it is asked for."""

from __future__ import annotations

import re
import textwrap
from itertools import pairwise
from typing import TYPE_CHECKING

from cyclopts import App, CycloptsError, Parameter
from cyclopts.help import PlainFormatter

from inercal import __version__
from inercal.cli.tree_laboratory import LABORATORY
from inercal.foundation.errors import UsageError

if TYPE_CHECKING:
    from cyclopts.help import HelpPanel
    from rich.console import Console, ConsoleOptions

#: verb, kind -> where it is, what it does, an example that runs
COMMANDS = {
    ("new", "imu"): (
        "inercal.cli.package:new_imu",
        "Write a commented study for `inercal calibrate imu`.\n\nGiven a recording, also a column map guessed from "
        "it, and a table of sections (sections.csv) where names of files or the data tell them. The study goes to "
        "--out (imu.toml if absent), the others beside it. Nothing that exists is overwritten.",
        'inercal new imu log.csv --set site.latitude="48.1 deg" --out imu.toml',
    ),
    ("new", "strapdown"): (
        "inercal.cli.package:new_strapdown",
        "Write a commented study of a strapdown unit: of its simulation and its calibration.\n\nGiven a recording "
        "whose header does not say quantities and units, also a column map guessed from it. The study goes to --out "
        "(strapdown.toml if absent), the map beside it (strapdown-map.toml). Nothing that exists is overwritten.",
        "inercal new strapdown --out strapdown.toml",
    ),
    ("new", "turntable"): (
        "inercal.cli.package:new_turntable",
        "Write a commented study of a turntable: of its sensitivity, design, simulation and calibration.\n\nGiven a "
        "recording, it is for the instrument in it; where the header does not say quantities and units, a column map "
        "is guessed too. The study goes to --out (turntable.toml if absent), the map beside it (turntable-map.toml). "
        "Nothing that exists is overwritten.",
        "inercal new turntable --out turntable.toml",
    ),
    ("new", "selfcal"): (
        "inercal.cli.package:new_selfcal",
        "Write a commented study of a self-calibration: of its simulation, path design and estimation.\n\nGiven a "
        "recording whose header does not say quantities and units, also a column map guessed from it. The study goes "
        "to --out (selfcal.toml if absent), the map beside it (selfcal-map.toml). Nothing that exists is overwritten.",
        "inercal new selfcal --out selfcal.toml",
    ),
    ("new", "aoa"): (
        "inercal.cli.package:new_aoa",
        "Write a commented study of an angle of attack: of its simulation and its measurement.\n\nGiven a recording "
        "whose header does not say quantities and units, also a column map guessed from it. The study goes to --out "
        "(aoa.toml if absent), the map beside it (aoa-map.toml). Nothing that exists is overwritten.",
        "inercal new aoa --out aoa.toml",
    ),
    ("new", "lab"): (
        "inercal.cli.package:new_lab",
        "Write a commented lab.toml: what a laboratory states in its certificates.\n\nIt goes to --out (lab.toml if "
        "absent). Nothing that exists is overwritten.",
        "inercal new lab --out lab.toml",
    ),
    ("inspect", ""): (
        "inercal.cli.recordings:inspect",
        "Look at a recording before it is used.\n\nChannels, units, rates, and everything suspicious about it; "
        "--report writes a page with pictures. Findings do not change the exit code.",
        "inercal inspect log.csv --report log.html",
    ),
    ("calibrate", "imu"): (
        "inercal.cli.calibrate:calibrate_imu",
        "Calibrate an IMU held by hand, set on its sides and turned, or turned by a table.\n\nGives bias, scale factor "
        "and misalignment of the accelerometers, and of the gyro if there is one, with uncertainties; of repeat runs "
        "the combined values; of the methods known_rates and known_turns FILEs are in order, one "
        "for each rate or turn. Without --study the recording tells the method, and --latitude the site. "
        "--out saves them (.json or .toml), --report writes a page to hand over. Exit code 1: done, but the verdict is "
        "not ok.",
        "inercal calibrate imu log.csv --study imu.toml --report cal.html",
    ),
    ("calibrate", "strapdown"): (
        "inercal.cli.calibrate:calibrate_strapdown",
        "Calibrate a strapdown unit from rests and coarse turns, without a table.\n\nThe unit stands still, is turned "
        "by hand or on a coarse frame, stands still again; no angle is known. The zero velocity at rest gives bias, "
        "scale factor and misalignment of both triads, second-order coefficients, lever arms and the delay between the "
        "triads, with uncertainties. --out saves them (.json or .toml), --report writes a page to hand over. Exit code "
        "1: done, but the verdict is not ok.",
        "inercal calibrate strapdown log.csv --study unit.toml --out cal.json",
    ),
    ("calibrate", "turntable"): (
        "inercal.cli.calibrate:calibrate_turntable",
        "Calibrate an instrument that was taken through positions on a turntable.\n\nGives the coefficients of a "
        "gyrowheel, gyro or accelerometer with uncertainties that hold the errors of the table, and which of them "
        "to tighten. --out saves them (.json or .toml), --report writes a page to hand over. Exit code 1: done, but "
        "the verdict is not ok.",
        "inercal calibrate turntable test.csv --study turntable.toml",
    ),
    ("selfcal", ""): (
        "inercal.cli.calibrate:selfcal",
        "Calibrate a gimbaled platform, or hybrid system, from a recording made while it turns.\n\nGives bias, "
        "misalignment and scale factor of gyros and accelerometers with uncertainties, and what the path could not "
        "tell. --filter chooses the estimator, --compare runs all. --out saves the coefficients (.json or .toml), or "
        "their histories: attitude, coefficients with u, and NIS of each row (.csv, .npz, .h5, .parquet or .nc). "
        "--report writes a page to hand over. With --stream CSV lines come in, from FILE or standard input, and the "
        "lines of that history go out, live; with --checkpoint the same command goes on where it was stopped. Exit "
        "code 1: done, but the verdict is not ok.",
        "inercal selfcal platform.csv --study selfcal.toml --report selfcal.html",
    ),
    ("aoa", ""): (
        "inercal.cli.aoa:aoa",
        "Measure the angle of attack of a wind-tunnel model from accelerometers and a gyro inside it.\n\nA filter that "
        "fuses all sensors gives the pitch angle with its uncertainty, causal or, with --smooth, from the whole "
        "recording; any of --static, --centrifugal and --tangential asks for the classical way. --out saves the result "
        "(.json or .toml, the prior of a next run) or the samples (.csv, .npz, .h5, .parquet or .nc), with --points "
        "the angle of each pause. --report writes a page to hand over. --runs RUNS.csv measures all runs of an entry, "
        "a row each with file and role (wind-off, up, down, run), with the tare of the wind-offs interpolated, and "
        "sums them up by point and by oscillation; --join sets the table of a balance beside the points. With --stream "
        "CSV lines come in, from FILE or standard input, and the lines of the samples go out, live; with --checkpoint "
        "the same command goes on where it was stopped. Exit code 1: done, but the verdict is not ok.",
        "inercal aoa model.csv --study aoa.toml --report aoa.html",
    ),
    ("allan", ""): (
        "inercal.cli.recordings:allan",
        "Tell the noise of an instrument from a recording at rest.\n\nOverlapping Allan deviation of each channel with "
        "confidence limits, and angle or velocity random walk N, bias instability B, rate random walk K, ramp R and "
        "quantisation Q with uncertainties. --out saves them (.json or .toml) or the curves (.csv), --report writes a "
        "page with pictures. Exit code 1: done, but the instrument was not at rest.",
        "inercal allan static.csv --report noise.html",
    ),
    ("sensitivity", ""): (
        "inercal.cli.design:sensitivity",
        "Say which error of a turntable matters for what the instrument should read.\n\nSobol indices of first and "
        "total order and Shapley effects, exactly or from samples, over the positions of the study. --out writes "
        "the maps (.nc or .npz), --report a page with pictures.",
        "inercal sensitivity turntable.toml --out maps.nc",
    ),
    ("design", "positions"): (
        "inercal.cli.design:design_positions",
        "Find the positions of a turntable that calibrate an instrument best, and compare them with plans of the "
        "field.\n\n--out writes the positions (.csv) or the whole result (.json), --report a page with pictures.",
        "inercal design positions turntable.toml --out positions.csv",
    ),
    ("design", "tolerances"): (
        "inercal.cli.design:design_tolerances",
        "Find the cheapest tolerances of a turntable, and the plan, that reach wanted uncertainties.\n\nThe study "
        "states the goals under [goal] and what tolerances cost under [cost]. --out writes the tolerances and "
        "positions as tables of a study (.toml) or the whole result (.json), --report a page with pictures.",
        "inercal design tolerances turntable.toml --out tolerances.toml",
    ),
    ("design", "selfcal"): (
        "inercal.cli.design:design_selfcal",
        "Find the path on which a platform calibrates itself best, and compare it with others of the same "
        "time.\n\nBounds of all coefficients before the test, within rate, time and limits of the gimbals. --out "
        "writes the path as the table [plan] of a study (.toml) or the whole result (.json), --report a page with "
        "pictures.",
        "inercal design selfcal selfcal.toml --out plan.toml",
    ),
    ("design", "strapdown"): (
        "inercal.cli.design:design_strapdown",
        "Say what the turns of a strapdown unit tell, and find better ones in the same time.\n\nBounds of all "
        "coefficients before the test, after each turn; with a table [design] in the study, a search for turns and the "
        "first attitude, beside the path of 19 positions. --out writes the turns as the table [plan] of a study "
        "(.toml) or the whole result (.json), --report a page with pictures.",
        "inercal design strapdown unit.toml --out plan.toml",
    ),
    ("design", "sections"): (
        "inercal.cli.design:design_sections",
        "Say what sections of an IMU tell before a test, and which one more would help most.\n\nThe STUDY states the "
        "sections, or is a table of them (.csv). --out writes the result (.json or .toml), --report a page.",
        "inercal design sections sections.csv",
    ),
    ("design", "aoa"): (
        "inercal.cli.design:design_aoa",
        "Say what the sensors of a wind-tunnel model can tell of its angle, beside other layouts, and how good they "
        "must be.\n\nThe study states the motion, under [layouts.NAME] where accelerometers might sit instead, and "
        "under [goal] the wanted u of theta. Bounds by the fusion and from single samples. --out writes the result "
        "(.json or .toml), --report a page.",
        "inercal design aoa aoa.toml --report layouts.html",
    ),
    ("simulate", "turntable"): (
        "inercal.cli.simulate:simulate_turntable",
        "Simulate a test on a turntable, with the errors of the table and the noise of the instrument.\n\nThe study "
        "states the true coefficients under [instrument.coefficients], and under [disturbances] what real tests add. "
        "The recording goes to --out (.csv, .npz, .h5, .parquet or .nc).",
        "inercal simulate turntable turntable.toml --seed 1 --out test.csv",
    ),
    ("simulate", "imu"): (
        "inercal.cli.simulate:simulate_imu",
        "Simulate an IMU in its sections, one after the other, or held by hand in many poses.\n\nThe study states true "
        "coefficients under [simulation], or they are drawn. The recording goes to --out (.csv, .npz, .h5, .nc, ...).",
        "inercal simulate imu imu.toml --seed 1 --out log.csv",
    ),
    ("simulate", "strapdown"): (
        "inercal.cli.simulate:simulate_strapdown",
        "Simulate a strapdown unit that rests and is turned.\n\nThe study states rests and turns under [plan], the "
        "true coefficients under [truth], and under [motion] how unsteadily it is turned. The recording goes to --out "
        "(.csv, .npz, .h5, .parquet or .nc): rates and specific forces.",
        "inercal simulate strapdown strapdown.toml --seed 1 --out log.csv",
    ),
    ("simulate", "selfcal"): (
        "inercal.cli.simulate:simulate_selfcal",
        "Simulate a platform in gimbals that turns through the plan of a study, once or many times.\n\nThe study "
        "states the true coefficients under [truth], and under [disturbances] what real rigs add. The recording goes "
        "to --out (.csv, .npz, .h5, .parquet or .nc): commanded rates, gimbal angles, accelerometers. With --runs N it "
        "is simulated and calibrated N times, and errors are judged by the stated uncertainties and the bound; --out "
        "then writes the figures (.json), --report a page. Exit code 1: the uncertainties are too small.",
        "inercal simulate selfcal selfcal.toml --seed 1 --out platform.csv",
    ),
    ("simulate", "aoa"): (
        "inercal.cli.simulate:simulate_aoa",
        "Simulate a wind-tunnel model that moves as its study plans.\n\nThe study states the motion under [motion], "
        "and under [disturbances] what real models add. The recording goes to --out (.csv, .npz, .h5, .parquet or "
        ".nc): accelerometers and gyro, in volts or counts where the study has a scale for these, point numbers of a "
        "pitch-pause, and the true angle as theta_ref.",
        "inercal simulate aoa aoa.toml --seed 1 --out model.csv",
    ),
    ("temperature", ""): (
        "inercal.cli.calibrate:temperature",
        "Fit what a sensor's output, or its calibration, does with temperature.\n\nFrom one recording at rest over a "
        "sweep of temperature, or from calibrations made at several temperatures (in the order of time): a polynomial "
        "with uncertainties, jumps and hysteresis. --out saves it (.json or .toml), --report writes a page with "
        "pictures.",
        "inercal temperature sweep.csv --map sweep-map.toml --report t.html",
    ),
    ("apply", ""): (
        "inercal.cli.saved:apply",
        "Correct a recording with a calibration.\n\nWrites specific force [m/s^2] and rate [rad/s] to --out (.csv, "
        ".npz, .h5, .parquet or .nc). Of an instrument that was calibrated on a turntable the drift is compensated by "
        "the specific force (acc_x acc_y acc_z) or the angles of the table, and the rate left is rate_x, rate_y; a "
        "temperature model goes by the temperature of each sample. A self-calibration makes of wanted rates (wc) "
        "commands that turn the platform so, and corrects its gyros and accelerometers, all in the units of the "
        "recording. With --uncertainty the standard uncertainty of each value, by that of the coefficients, stands in "
        "a column u_acc_x, u_rate_x, ... With --invert the recording holds true values and the outputs of the "
        "instrument are written. With --stream CSV lines come in on standard input and corrected ones go out, each at "
        "once.",
        "inercal apply cal.json log.csv --out corrected.csv",
    ),
    ("compare", ""): (
        "inercal.cli.saved:compare",
        "Compare two calibrations of one instrument, run to run.\n\nThe difference of each coefficient over its "
        "uncertainty, the normalised error E_n, and whether all differences together are explained; sources common "
        "to both are taken off. --out saves the differences (.json or .toml), --report writes a page. Exit code 1: "
        "done, but the calibrations differ by more than their uncertainties explain.",
        "inercal compare before.json after.json --report drift.html",
    ),
    ("convert", ""): (
        "inercal.cli.saved:convert",
        "Convert a calibration to another tool's convention, or from it.\n\n--to writes the file that imu_tk, "
        "imucal, Kalibr or PSINS reads (imu_tk: one for each sensor), of the noise of `inercal allan` that of Kalibr, "
        "OpenVINS or VINS; without --out it is printed. --from reads "
        "such a file and writes a calibration (.json or .toml) for `inercal apply`; what the file does not state, "
        "such as uncertainty, stays unknown. Exit code 1: done, but the verdict on the calibration is not ok.",
        "inercal convert cal.json --to imucal --out cal_imucal.json",
    ),
    ("monitor", ""): (
        "inercal.cli.recordings:monitor",
        "Watch an instrument live: is it at rest, for how long, and how noisy?\n\nCSV lines come in, from FILE or "
        "standard input, and lines go out: rest against a quiet start of five seconds, and since the last motion mean, "
        "standard deviation, random walk N and Allan deviation of each channel. With --checkpoint the same command "
        "goes on where it was stopped.",
        "inercal monitor log.csv --every '1 s'",
    ),
    ("certificate", ""): (
        "inercal.cli.certificate:certificate",
        "Write a digital calibration certificate of results of one instrument, or read one.\n\nXML by PTB's schema DCC "
        "3.2.1, validated before it is written to --out: the coefficients with U, k and covariance in SI, method, "
        "equipment and conditions, and the results themselves as files. --html writes it as a page. Only results that "
        "are ok get one. With --read a certificate of anybody is read and its numbers printed; `inercal apply` and "
        "`inercal compare` take one in the place of a calibration.",
        "inercal certificate cal.json --lab lab.toml --number 7 --out cal.xml",
    ),
    ("validate", ""): (
        "inercal.cli.package:validate",
        "Rerun the published and closed-form cases that ship with inercal, for the validation of software in a "
        "laboratory.\n\nOne line for each case: what was found, what was expected within which limit, and from which "
        "source. --out saves the record with versions (.json or .toml), --report writes a page to sign and to file. "
        "Exit code 1: a case failed.",
        "inercal validate --report validation.html",
    ),
    **LABORATORY,
    ("schema", ""): (
        "inercal.cli.package:schema",
        "Print one JSON Schema that covers every kind of study file, for editors and checkers.",
        "inercal schema --out inercal.schema.json",
    ),
    ("completion", ""): (
        "inercal.cli.package:completion",
        "Print the script by which a shell completes commands, options, choices and file names.\n\nBash reads it from "
        "~/.local/share/bash-completion/completions/inercal, zsh from the file _inercal in a folder of $fpath, fish "
        "from ~/.config/fish/completions/inercal.fish: write it there with --out. For one session of bash: "
        "source <(inercal completion bash).",
        "inercal completion bash --out inercal.bash",
    ),
    ("examples", ""): (
        "inercal.cli.package:examples",
        "List the recordings that ship with inercal, or copy one.\n\nA copy comes with its study and map, in the "
        "folder --out (named after the example if absent).",
        "inercal examples xsens --out xsens",
    ),
}

_GROUPS = {
    "new": "Write a commented study, and a map guessed from a recording; or lab.toml.",
    "calibrate": "Calibrate an instrument from a recording.",
    "design": "Design a test before it is made.",
    "simulate": "Simulate a recording of a test.",
    "store": "The store of a laboratory: results kept for years.",
}


class _Hanging(PlainFormatter):
    """Entries in plain text, broken once at the width of the terminal, what follows further in."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        """Print the entries of a panel."""
        from rich.console import Console

        if not panel.entries:
            return
        endless = Console(width=10_000, color_system=None)
        with endless.capture() as captured:
            super().__call__(endless, options, panel)
        for line in captured.get().rstrip("\n").split("\n"):
            broken = textwrap.wrap(
                line, console.width, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
            )
            console.print("\n".join(broken), highlight=False, markup=False, soft_wrap=True)
        console.print()


def app() -> App:
    """The tree of commands; the module of each is loaded only when it is asked for."""
    root = App(
        name="inercal",
        help="Calibrate inertial instruments, and say how sure one can be of every number.",
        help_epilogue="Example: inercal examples xsens",
        version=__version__,
        default_parameter=Parameter(negative=(), show_default=False),
        help_format="plaintext",
        help_formatter=_Hanging(),
        exit_on_error=False,
        print_error=False,
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    groups: dict[str, App] = {}
    for (verb, kind), (where, text, example) in COMMANDS.items():
        epilogue = f"Example: {example}"
        if not kind:
            root.command(where, name=verb, help=text, help_epilogue=epilogue)
            continue
        if verb not in groups:
            groups[verb] = App(name=verb, help=_GROUPS[verb], help_epilogue=epilogue)
            root.command(groups[verb])
        groups[verb].command(where, name=kind, help=text, help_epilogue=epilogue)
    return root


def call(arguments: list[str]) -> int | None:
    """Run a command line; raises `UsageError` where the line itself is wrong."""
    for before, argument in pairwise(("inercal", *arguments)):
        if argument == "" or re.fullmatch("--[a-z]+=", argument):
            option = argument.rstrip("=") or before
            raise UsageError(f"the text after {option} is empty, expected a name or a value")
    kinds = [kind for verb, kind in COMMANDS if kind and verb == (arguments or [""])[0]]
    if kinds and all(word.startswith("-") and word not in ("-h", "--help") for word in arguments[1:]):
        raise UsageError(f"{arguments[0]}: found no kind, expected {' or '.join(kinds)} after it")
    root = app()
    if {"-h", "--help"} & {*arguments}:
        for verb, kind in COMMANDS:
            if arguments[0] == verb and kind in ("", *arguments[1:2]):
                asked = root[verb][kind] if kind else root[verb]
                asked.usage = usage(asked, verb, kind)
    try:
        code: int | None = root(arguments)
    except CycloptsError as error:
        raise UsageError(refused(root, error)) from error
    return code


def refused(root: App, error: CycloptsError) -> str:
    """The refusal of a command line, in a sentence."""
    from inercal.cli.refusals import refusal

    kinds: dict[str, list[str]] = {}
    for verb, kind in COMMANDS:
        kinds.setdefault(verb, []).extend([kind] if kind else [])
    verb, kind = (*(error.command_chain or ()), "", "")[:2]
    called = usage(root[verb][kind] if kind else root[verb], verb, kind) if (verb, kind) in COMMANDS else ""
    return refusal(error, kinds, called)


def usage(command: App, verb: str, kind: str) -> str:
    """Usage of a command: its arguments, in brackets where they may be absent, and the options that it needs."""
    given = [each for each in command.assemble_argument_collection() if each.show]
    arguments = [each for each in given if not each.name.startswith("-")]
    options = [each for each in given if each.name.startswith("-") and each.required]
    parts = [each.name if each.required else f"[{each.name}]" for each in arguments]
    parts += [f"{each.name} {each.hint.__name__.upper()}" for each in options]
    return " ".join(["inercal", verb, *([kind] if kind else []), *parts, "[OPTIONS]"])
