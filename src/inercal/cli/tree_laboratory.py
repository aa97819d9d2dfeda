"""The commands of the laboratory, of many units and of instruments by wire: entries of the tree."""

#: as `inercal.cli.tree.COMMANDS`
LABORATORY = {
    ("store", "init"): (
        "inercal.cli.store:store_init",
        "Make an empty store for the results of a laboratory.\n\nA folder (--store, INERCAL_STORE, else the user's "
        "data folder), or an empty PostgreSQL database by its URL, with --objects for the files. Results are only ever "
        "added; every step is an event in a chain of hashes.",
        "inercal store init --store lab",
    ),
    ("store", "upgrade"): (
        "inercal.cli.store:store_upgrade",
        "Bring a store that an older inercal made to the version of this one.",
        "inercal store upgrade --store lab",
    ),
    ("store", "check"): (
        "inercal.cli.store:store_check",
        "Check that a store is as it was written, and name what was changed, missing or added.\n\nChain of events, "
        "rows, files, foreign keys. Note the head of the chain: later it shows that nothing was cut off. Exit code 1: "
        "there are faults.",
        "inercal store check --store lab",
    ),
    ("store", "scrub"): (
        "inercal.cli.store:store_scrub",
        "Take passwords, keys and tokens of addresses out of a store that inercal 0.2.0 or earlier wrote them into.\n\n"
        "What held one is written anew with *** in its place, and an event in the chain says so, with the head of the "
        "chain before. Change the passwords all the same: exports, certificates and backups hold them still.",
        "inercal store scrub --store lab",
    ),
    ("store", "export"): (
        "inercal.cli.store:store_export",
        "Copy a store into a folder, which is a store itself, with rows, chain and files as they are.",
        "inercal store export copy --store lab",
    ),
    ("store", "import"): (
        "inercal.cli.store:store_import",
        "Add what the store in a folder has and this one lacks.",
        "inercal store import copy --store lab",
    ),
    ("keep", ""): (
        "inercal.cli.store:keep",
        "Keep a result that was made elsewhere in the store.\n\nThe files it rests on are kept too, where they are "
        "still as they were. A result that is kept already adds nothing. The option --keep of other commands does this "
        "at once.",
        'inercal keep cal.json --report cal.html --instrument "Xsens, MTi, 1234"',
    ),
    ("instruments", ""): (
        "inercal.cli.store:instruments",
        "List the instruments of a store, with the number of their results.",
        "inercal instruments --store lab",
    ),
    ("results", ""): (
        "inercal.cli.store:results",
        "List the results of a store, by date.",
        "inercal results --instrument 1234 --since 2026-01-01 --status ok",
    ),
    ("show", ""): (
        "inercal.cli.store:show",
        "Show a result of a store: where it comes from, its coefficients, its verdict.\n\n--out writes the result "
        "(.json or .toml), --report the page that was kept with it.",
        "inercal show 6fee8a0a58 --report cal.html",
    ),
    ("history", ""): (
        "inercal.cli.store:history",
        "Follow the coefficients of an instrument from calibration to calibration.\n\nControl charts, drift and random "
        "walk, the value to expect at a date with its uncertainty, and with --tolerance conformity and the date of the "
        "next calibration. --out writes the result (.json or .toml) or all calibrations (.csv), --report a page with "
        "the charts. Exit code 1: the last calibration alarms, or is outside a tolerance.",
        "inercal history 1234 --tolerance spec.toml --report history.html",
    ),
    ("supersede", ""): (
        "inercal.cli.store:supersede",
        "Say that a result takes the place of another of the same instrument, and why.\n\nBoth stay in the store; "
        "histories leave the superseded one out.",
        'inercal supersede 6fee8a0a58 b1946ac924 --reason "wrong gravity"',
    ),
    ("rerun", ""): (
        "inercal.cli.store:rerun",
        "Make a kept result once more by this inercal, from the files that were kept with it.\n\nSays of each "
        "coefficient whether it is equal to the last digit, within u, or changed. Exit code 1: something changed.",
        "inercal rerun 6fee8a0a58",
    ),
    ("batch", ""): (
        "inercal.cli.calibrate:batch",
        "Calibrate every unit of a fleet by one study.\n\nThe manifest is a CSV with the columns serial and files "
        "(divided by `;`, paths or URLs), and a column for each key of the study that is a unit's own; or a folder of "
        "recordings. OUT gets units.csv, units.parquet, fleet.html, fleet.json and a result for each unit. A unit that "
        "fails is a row that says why; what is there already is not done again. Exit code 1: not all units are good.",
        "inercal batch fleet.csv --study imu.toml --out fleet",
    ),
    ("live", ""): (
        "inercal.cli.bench:live",
        "Measure an instrument by wire: a serial port, UDP, TCP or MQTT, or a recording played again.\n\nText lines "
        "or binary frames that the map describes, come in; what the kind of the study gives row by row goes out to "
        "sinks: angles, coefficients, rest and noise, or with --apply corrected samples. A source that dies is "
        "tried again; what is lost, out of order, late or dropped is counted and said. --record keeps the raw rows, of "
        "which replay: gives the same digits. User and password of a broker are in INERCAL_MQTT_USER and "
        "INERCAL_MQTT_PASSWORD, or in a file named by ?login=FILE. Ctrl-C ends it in order.",
        "inercal live udp://127.0.0.1:5005 --study aoa.toml",
    ),
    ("workbench", ""): (
        "inercal.cli.bench:workbench",
        "Work in the browser: from a raw log to a certificate, on this machine and without any network.\n\n"
        "Sessions and jobs lie in FOLDER and are found again when it is begun anew. The page shows the command "
        "and the study for every step. Programs find the same under /api/v1. The extra `workbench` is needed.",
        "inercal workbench",
    ),
}
