use crate::cli::options::args::*;
use crate::cli::options::scene_kind::SceneKind;
use crate::cli::output::Usage;
use crate::schedule::Optimisation;
use crate::session::Settings;
use crate::settings::{Direction, EffectList, HostCacheSize, Level, Schedule};
use crate::stream::Policy;
use brickwalk_convert::build::LatticeStep;
use brickwalk_scenes::{Kind, Stiff};
use clap::CommandFactory;
use clap::error::ErrorKind;

fn parse(line: &str) -> Result<Command, clap::Error> {
    Cli::try_parse_from(std::iter::once("brickwalk").chain(line.split_whitespace())).map(|cli| cli.command)
}

fn walk_args(options: &str) -> Result<WalkArgs, clap::Error> {
    parse(&format!("walk s.bricks -o out {options}")).map(|command| match command {
        Command::Walk(args) => *args,
        other => panic!("{other:?}"),
    })
}

fn walk(options: &str) -> Result<Settings, clap::Error> {
    Ok(walk_args(options)?.settings().unwrap())
}

#[test]
fn the_definition_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn without_options_settings_are_those_of_previews() {
    // The adapter may be that of the environment.
    let adapter = walk("").unwrap().adapter;
    assert_eq!(walk("").unwrap(), Settings { adapter, ..Settings::from_options("--quality preview").unwrap() });
}

#[test]
fn options_arrive() {
    let w = walk(
        "--path p.json --frames 3 --size 64x32 --cache 12M --host-cache 2G --schedule plain --effects primary --spp 4 \
         --seed 9 --aov --sun -1,2,-3 --sun-angle 0 --sun-intensity 5 --sky-intensity 0 --tile 32 --workers 2 \
         --fov 1e-6 --adapter llvm --secondary exact --fronts on --query-threshold 20 --evict lru --dvf-cells 40 \
         --requests-out f.jsonl --measure-needed --roma-unsnapped ao,shadow",
    )
    .unwrap();
    let expected = Settings {
        path: Some("p.json".into()),
        frames: 3,
        size: ImageSize { width: 64, height: 32 },
        cache: CacheSize::Bytes(12 << 20),
        host_cache: HostCacheSize::Bytes(2 << 30),
        schedule: Schedule::Plain,
        effects: EffectList::PRIMARY,
        spp: 4,
        seed: 9,
        aov: true,
        sun: Direction([-1.0, 2.0, -3.0]),
        sun_angle: 0.0,
        sun_intensity: Some(5.0),
        sky_intensity: 0.0,
        tile: 32,
        workers: Some(2),
        fov: Some(1e-6),
        adapter: Adapter::Named("llvm".into()),
        fronts: true,
        query_threshold: 20,
        evict: Policy::Lru,
        requests_out: Some("f.jsonl".into()),
        measure_needed: true,
        ..w.clone()
    };
    assert_eq!(w, expected);
    assert_eq!(w.dvf.cells, crate::secondary::dvf::Cells::Longest(40));
    assert_eq!(w.roma.unsnapped.len(), 2);
    assert_eq!(walk("--hash-threads 3").unwrap().worker_count(), 3);
    assert!(walk_args("--json").unwrap().json && !walk("--aov=off").unwrap().aov);
}

#[test]
fn the_command_line_wins_over_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("f.toml");
    std::fs::write(&file, "frames = 7\nspp = 2\ndenoise = true\n[dvf]\nrays = 8\n").unwrap();
    let w = walk(&format!("--settings {} --spp 4 --denoise=off", file.display())).unwrap();
    assert_eq!((w.frames, w.spp, w.denoise, w.dvf.rays, w.tile), (7, 4, false, 8, 64));
    let wrong = walk_args("--settings missing.toml").unwrap().settings().unwrap_err();
    assert!(format!("{wrong:#}").contains("missing.toml"));
    // What is printed needs neither scene nor output, and is read again.
    let Command::Walk(args) = parse("walk --print-settings --spp 3").unwrap() else { panic!() };
    let printed = args.settings().unwrap();
    assert!(args.print_settings && args.files().is_err());
    assert_eq!(Settings::from_toml(&printed.to_toml()), Ok(printed));
}

#[test]
fn help_has_three_lengths() {
    let options = |command: &clap::Command, is_shown: fn(&clap::Arg) -> bool| {
        command.get_arguments().filter(|argument| !argument.is_hide_set() && is_shown(argument)).count()
    };
    let mut cli = Cli::command();
    cli.build();
    let walk = cli.find_subcommand("walk").unwrap();
    let short = options(walk, |argument| !argument.is_hide_short_help_set());
    let long = options(walk, |argument| !argument.is_hide_long_help_set());
    assert!(short <= 19 && long <= 50, "{short} and {long} options");
    let text = parse("walk -h").unwrap_err().to_string();
    assert!(text.lines().count() <= 50 && text.contains("--cache") && !text.contains("--dvf-points"), "{text}");
    let text = parse("walk --help").unwrap_err().to_string();
    for part in
        ["1280x720", "[default: auto]", "[default: 30]", "degrees", "[default: 0.4,0.8,0.45]", "Camera:", "Light:"]
    {
        assert!(text.contains(part), "walk --help lacks {part}: {text}");
    }
    assert!(!text.contains("--dvf-points"));
    let text = crate::cli::help_all(&["brickwalk", "walk", "--help-all"].map(Into::into));
    for entry in <Settings as crate::settings::Group>::entries() {
        assert!(text.contains(&format!("--{}", entry.field.flag())), "{}", entry.key());
    }
    assert!(<Settings as crate::settings::Group>::entries().iter().any(|e| e.field.level == Level::Expert));
}

#[test]
fn wrong_values_are_usage_errors_that_say_what_is_right() {
    for (options, part) in [
        ("--frames 0", "1 to 1000000"),
        ("--frames 1.5", "whole number"),
        ("--size 0x720", "1 to 16384"),
        ("--size 99999x1", "1 to 16384"),
        ("--cache 0", "at least 1"),
        ("--cache 101%", "100 %"),
        ("--cache 99999999999G", "64 bits"),
        ("--host-cache 1.5", "whole number"),
        ("--schedule fastest", "known: chc, demand, plain, plain-bvh2, auto"),
        ("--effects glitter", "no 'glitter'"),
        ("--effects=", "known: primary, shadow"),
        ("--dvf-cells 0", "it must be from 1 to 512, or auto"),
        ("--dvf-octahedral 12", "it must be one of 8, 16, 32"),
        ("--roma-k 5", "one of 4, 8"),
        ("--roma-size 100", "32, 64, 128, 256"),
        ("--roma-samples 3", "1, 2, 4"),
        ("--roma-unsnapped glossy", "known: none, shadow, ao, diffuse, all"),
        ("--roma-steps 65", "1 to 64"),
        ("--df-size 100", "32, 64, 128, 256"),
        ("--df-steps 0", "1 to 1024"),
        ("--df-lift 9", "from 0 to 8"),
        ("--df-hit 0", "from 0.01 to 8"),
        ("--spp 0", "from 1"),
        ("--seed -1", "-1"),
        ("--sun 0,0,0", "not all 0"),
        ("--sun-angle 91", "90 degrees"),
        ("--sun-intensity nan", "finite"),
        ("--sky-intensity=-1", "at least 0"),
        ("--tile 48", "power of two"),
        ("--tile 1024", "power of two"),
        ("--workers 0", "from 1"),
        ("--fov 180", "179.99"),
        ("--fov nan", "179.99"),
        ("--fronts yes", "known: on, off"),
        ("--query-threshold 40001", "0 to 40000"),
        ("--evict fifo", "known: round-robin, second-chance, lru"),
        ("--environment-rotation 361", "-360 to 360"),
        ("--environment-intensity=-1", "at least 0"),
        ("--nonsense", "--nonsense"),
    ] {
        let error = walk(options).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{options}");
        assert!(error.to_string().contains(part), "{options}: {error}");
    }
}

#[test]
fn other_commands_check_too() {
    for (line, part) in [
        ("", "Usage"),
        ("fly", "fly"),
        ("convert -o s.bricks", "INPUT"),
        ("convert a.gltf", "--output"),
        ("convert a.gltf -o s.bricks --brick-triangles 0", "from 1"),
        ("convert a.gltf -o s.bricks --memory 0", "at least 1"),
        ("convert a.gltf -o s.bricks --lattice 999", "999"),
        ("convert a.gltf -o s.bricks --lattice fine", "finest"),
        ("scene ruins -o s.bricks", "the kinds are: city"),
        ("scene castle -o s.bricks", "castle"),
        ("scene city -o s.bricks --triangles 0", "at least 1"),
        ("info", "S.bricks"),
        ("info s.bricks --id -1", "-1"),
        ("info s.bricks --id 4294967296", "4294967296"),
        ("verify", "S.bricks"),
        ("trace s.bricks -o h.npy", "--rays"),
        ("replay", "<F>"),
        ("replay f.jsonl --cache 0%", "above 0 %"),
        ("compare a.png", "<B>"),
        ("walk s.bricks", "--output"),
    ] {
        let error = parse(line).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{line}");
        assert!(error.to_string().contains(part), "{line}: {error}");
    }
}

#[test]
fn trace_refuses_what_is_for_walks() {
    let check = |options: &str| match parse(&format!("trace s.bricks --rays r.npy -o h.npy {options}")).unwrap() {
        Command::Trace(args) => args.settings(),
        other => panic!("{other:?}"),
    };
    assert!(check("").is_ok() && check("--any --cache 1M --evict lru --requests-out f").is_ok());
    for options in ["--fronts on", "--query-threshold 20", "--spp 4"] {
        assert!(check(options).unwrap_err().to_string().contains(options.split(' ').next().unwrap()), "{options}");
    }
}

#[test]
fn levels_of_given_rays_need_the_angle_of_a_pixel() {
    let line = |options: &str| format!("trace s.bricks --rays r.npy -o h.npy {options}");
    let of = |options: &str| match parse(&line(options)).unwrap() {
        Command::Trace(args) => args,
        other => panic!("{other:?}"),
    };
    let args = of("--lod 1.5 --spread 0.002");
    assert_eq!((args.settings().unwrap().lod, args.spread), (1.5, Some(0.002)));
    assert_eq!(of("").settings().unwrap().lod, 0.0);
    assert!(of("--lod 0").settings().is_ok() && of("--lod 0 --spread 1").settings().is_ok());
    assert!(of("--lod 1").settings().unwrap_err().to_string().contains("--spread"));
    for bad in ["--spread 0", "--spread -0.1", "--spread 1.01", "--spread nan", "--spread inf", "--spread wide"] {
        let error = parse(&line(&format!("--lod 1 {bad}"))).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{bad}");
        assert!(error.to_string().contains("radians"), "{bad}: {error}");
    }
    for bad in ["--lod -1", "--lod 1025", "--lod nan", "--lod far"] {
        let error = parse(&line(&format!("{bad} --spread 0.01"))).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{bad}");
    }
}

#[test]
fn options_of_other_commands_arrive() {
    let Command::Convert(c) =
        parse("convert a.gltf b.glb -o s.bricks --brick-triangles 4K --threads 2 --lattice -12 --drop-non-finite")
            .unwrap()
    else {
        panic!()
    };
    assert_eq!(c.inputs.inputs.len(), 2);
    assert_eq!(
        (c.build.brick_triangles, c.build.work.threads, c.build.work.lattice),
        (Some(4000), Some(2), Some(LatticeStep::Log2(-12)))
    );
    assert!(c.mesh.drop_non_finite);
    let Command::Scene(s) = parse("scene city -o s.bricks --triangles 200K --seed 7").unwrap() else { panic!() };
    assert_eq!((s.kind, s.triangles, s.seed), (SceneKind::Generated(Kind::City), Some(200_000), 7));
    assert_eq!((s.case, s.build.brick_triangles), (None, None));
    let Command::Scene(s) = parse("scene stiff --case slivers -o s.glb").unwrap() else { panic!() };
    assert_eq!((s.kind, s.case, s.triangles), (SceneKind::Stiff, Some(Stiff::Slivers), None));
    let help = parse("scene --help").unwrap_err().to_string();
    assert!(Stiff::ALL.iter().all(|kind| help.contains(kind.about())), "{help}");
    let Command::Replay(r) = parse("replay f.jsonl --cache 5% 1M,2M --cache 7K --json").unwrap() else { panic!() };
    assert_eq!(r.cache[..2], [CacheSize::Percent(5.0), CacheSize::Bytes(1 << 20)]);
    assert!(r.cache.len() == 4 && r.json);
    let Command::Repair(r) = parse("repair s.bricks --from a.gltf b.stl --up z --from c.ply --fast").unwrap() else {
        panic!()
    };
    let inputs: Vec<_> = r.inputs.inputs.iter().map(|input| (input.path.to_str().unwrap(), input.up)).collect();
    let z = Some(brickwalk_convert::import::Up::Z);
    assert_eq!(inputs, [("a.gltf", None), ("b.stl", z), ("c.ply", None)]);
    assert_eq!((r.scene, r.work.fast), (PathBuf::from("s.bricks"), true));
    let Command::Repair(r) = parse("repair s.bricks").unwrap() else { panic!() };
    assert!(r.inputs.inputs.is_empty());
    let Command::Demo(d) = parse("demo").unwrap() else { panic!() };
    assert_eq!(d.output, PathBuf::from("demo-out"));
}

/// Every subcommand's help explains units and names a default where an option with a value has one.
#[test]
fn help_explains_units_and_defaults() {
    let top = parse("--help").unwrap_err();
    assert_eq!((top.kind(), top.exit_code()), (ErrorKind::DisplayHelp, 0));
    let cli = Cli::command();
    let mut names: Vec<_> = cli.get_subcommands().map(|c| c.get_name().to_string()).collect();
    names.sort();
    let commands = [
        "adapters",
        "bake-displacement",
        "bench",
        "calibrate",
        "compare",
        "completions",
        "convert",
        "demo",
        "info",
        "jobs",
        "man",
        "query",
        "repair",
        "replay",
        "scene",
        "selftest",
        "serve",
        "study",
        "trace",
        "verify",
        "view",
        "walk",
    ];
    assert_eq!(names, commands);
    for name in commands {
        let name = if name == "bench" { "bench chc" } else { name };
        let command = name.split(' ').fold(&cli, |command, word| command.find_subcommand(word).unwrap());
        let help = parse(&format!("{name} --help")).unwrap_err();
        assert_eq!(help.exit_code(), 0, "{name}");
        let text = help.to_string();
        let has_units = text.contains("powers of 1024") && text.contains("Exit status");
        assert!(has_units || ["completions", "man"].contains(&name), "{name}: {text}");
        for argument in command.get_arguments().filter(|a| !a.is_hide_set()) {
            let described = argument.get_help().is_some_and(|h| h.to_string().len() > 5);
            assert!(described, "{name}: {} has no help", argument.get_id());
            let long = argument.get_long().map(|l| format!("--{l}"));
            if let Some(long) = long.filter(|_| !argument.is_hide_long_help_set()) {
                assert!(text.contains(&long), "{name}: {long}");
            }
            let is_switch = argument.get_num_args().is_some_and(|count| count.min_values() == 0);
            let optional = !argument.is_required_set() && argument.get_action().takes_values() && !is_switch;
            let has_default = !argument.get_default_values().is_empty()
                || argument.get_help().is_some_and(|h| h.to_string().contains("[default:"));
            // Scene and output of `walk` are required unless settings are printed.
            let filter = ["path", "adapter", "id", "scene", "output"].contains(&argument.get_id().as_str());
            assert!(!optional || has_default || filter, "{name}: {} states no default", argument.get_id());
        }
    }
}

#[test]
fn version_is_printed() {
    let version = parse("--version").unwrap_err();
    assert_eq!((version.kind(), version.exit_code()), (ErrorKind::DisplayVersion, 0));
}

#[test]
fn optimisations_are_switched_by_name() {
    let w = walk("--without requery,nearest-first").unwrap();
    assert_eq!(w.without, [Optimisation::Requery, Optimisation::NearestFirst]);
    assert_eq!(walk("--without requery --without nearest-first").unwrap().without, w.without);
    let error = walk("--without haste").unwrap_err().to_string();
    assert!(error.contains("known: nearest-first, requery"), "{error}");
    let conflict = walk_args("--schedule plain --without requery").unwrap().settings().unwrap_err();
    assert!(conflict.is::<Usage>() && conflict.to_string().contains("chc, demand or auto"));
}
