use super::*;
use crate::settings::page::options_page;
use crate::settings::{Effect, HostCacheSize, Level, Plain, file};
use std::collections::BTreeSet;
use std::path::PathBuf;

#[test]
fn defaults_are_the_documented_ones() {
    let s = Settings::exact();
    assert_eq!((s.frames, s.size), (30, ImageSize { width: 1280, height: 720 }));
    assert_eq!(s.effects.to_string(), "primary,shadow");
    assert_eq!((s.spp, s.seed, s.tile), (1, 0, 64));
    assert_eq!((s.cache, s.host_cache), (CacheSize::Auto, HostCacheSize::Auto));
    assert_eq!((s.secondary, s.schedule, s.fronts), (crate::secondary::EffectMethods::EXACT, Schedule::Auto, false));
    assert_eq!((s.query_threshold, s.evict), (0, crate::stream::Policy::RoundRobin));
    assert_eq!((s.sun, s.sun_angle, s.sun_intensity()), (Direction([0.4, 0.8, 0.45]), 0.53, 2.4));
    assert!(s.path.is_none() && !s.aov && s.fov.is_none() && s.worker_count() >= 1);
    assert_eq!((s.exposure, s.tone_map, s.environment), (Exposure::Fixed(0.0), ToneMap::None, None));
    assert_eq!((s.ao_rays, s.ao_length, s.diffuse_rays), (20, Length::World(0.5), 20));
    assert_eq!((s.rotation, s.denoise, s.taa), (Turn(36.0), false, false));
    let s = Settings::default();
    assert_eq!((s.effects.to_string().as_str(), s.spp, s.rotation), ("primary,shadow,ao", 4, Turn::FULL));
    assert_eq!(
        (s.exposure, s.tone_map, s.secondary),
        (Exposure::AUTO, ToneMap::AgX, crate::secondary::EffectMethods::EXACT)
    );
    assert_eq!((s.environment, s.ao_length), (Some(Environment::Auto), Length::Auto));
}

#[test]
fn keys_and_flags_are_unique_and_described() {
    let entries = Settings::entries();
    let keys: BTreeSet<String> = entries.iter().map(Entry::key).collect();
    let flags: BTreeSet<&str> = entries.iter().map(|entry| entry.field.flag()).collect();
    assert_eq!((keys.len(), flags.len()), (entries.len(), entries.len()));
    for entry in &entries {
        let (key, field) = (entry.key(), entry.field);
        assert!(field.usage.starts_with("--") && field.help().ends_with('.'), "{key}");
        assert!(!field.summary().is_empty() && field.summary().len() < 110, "{key}: {}", field.summary());
        // A switch is off by default, and says nothing of it.
        let is_switch = field.value_name().is_none();
        assert!(!is_switch || (field.default)() == Plain::Bool(false), "{key}");
        assert!(is_switch || !field.default_text().is_empty(), "{key} states no default");
        // Defaults are values.
        let mut settings = Settings::default();
        settings.set(&key, &(field.default)().to_string()).unwrap();
        assert_eq!(settings, Settings::default(), "{key}");
    }
    let common = entries.iter().filter(|entry| entry.field.level == Level::Common).count();
    let shown = entries.iter().filter(|entry| entry.field.level <= Level::Usual).count();
    assert!(common <= 10 && shown <= 40, "{common} and {shown} are too many for help");
    assert!(TRACE.iter().all(|key| keys.contains(*key)));
}

/// Settings none of which is as it is by default.
fn others() -> Settings {
    let mut settings = Settings::default();
    let mut entries = Settings::entries();
    entries.sort_by_key(|entry| !entry.field.is_preset);
    for entry in entries {
        let field = entry.field;
        let candidates = [
            "1000",
            "4",
            "on",
            "off",
            "7",
            "3",
            "8",
            "64",
            "0.25",
            "2",
            "1,2,3",
            "0,5,0,0,1,0",
            "0,0,0,1,0,0,0,0,1",
            "64x48",
            "roma",
            "a \"b\\c",
        ];
        let text = candidates.into_iter().chain(field.names.iter().copied()).rev();
        let other = text.into_iter().find(|text| {
            let mut one = Settings::default();
            one.set(&entry.key(), text).is_ok() && one != Settings::default()
        });
        settings.set(&entry.key(), other.unwrap_or_else(|| panic!("{} has one value", entry.key()))).unwrap();
    }
    settings
}

#[test]
fn what_is_printed_is_read_again() {
    for settings in [Settings::default(), others()] {
        let toml = settings.to_toml();
        assert_eq!(Settings::from_toml(&toml), Ok(settings.clone()), "{toml}");
        let json = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<Settings>(&json).unwrap(), settings, "{json}");
    }
    let toml = others().to_toml();
    for entry in Settings::entries() {
        assert!(toml.contains(&format!("\n{} = ", entry.field.key)), "{}", entry.key());
    }
    assert_eq!(Settings::default().options(), "");
    let some = Settings { schedule: Schedule::Chc, denoise: true, ..Settings::default() };
    assert_eq!(some.options(), "--denoise --schedule chc");
    assert_eq!(Settings::from_options(&some.options()), Ok(some));
    for (text, part) in [("--scedule chc", "--schedule"), ("--schedule", "needs a value"), ("chc", "no such")] {
        assert!(Settings::from_options(text).unwrap_err().to_string().contains(part), "{text}");
    }
}

#[test]
fn files_are_natural_to_write() {
    let settings = Settings::from_toml(
        "effects = [\"primary\", \"ao\"]\nsun = [-1, 2, 3.5]\nsize = \"64x48\"\ncache = \"12M\"\nrotation = \"full\"\n\
         exposure = -1.5\nfronts = true\nwithout = []\nhost_cache = \"2G\"\n[dvf]\ncells = 40\n\
         [roma]\nerror = \"off\"\n",
    );
    let expected = Settings {
        effects: EffectList::of(&[Effect::Ao]),
        sun: Direction([-1.0, 2.0, 3.5]),
        size: ImageSize { width: 64, height: 48 },
        cache: CacheSize::Bytes(12 << 20),
        rotation: Turn::FULL,
        exposure: crate::picture::Exposure::Fixed(-1.5),
        fronts: true,
        host_cache: HostCacheSize::Bytes(2 << 30),
        dvf: crate::secondary::dvf::Options { cells: crate::secondary::dvf::Cells::Longest(40), ..Default::default() },
        roma: crate::secondary::roma::Options { error: None, ..Default::default() },
        ..Settings::default()
    };
    assert_eq!(settings, Ok(expected));
}

#[test]
fn what_is_wrong_is_named_with_what_is_right() {
    for (text, parts) in [
        ("frame = 3", vec!["frame: there is no such setting", "frames"]),
        ("frames = 0", vec!["frames: it must be from 1 to 1000000"]),
        ("frames = \"many\"", vec!["frames: "]),
        ("schedule = \"fast\"", vec!["schedule: there is no 'fast'", "chc, demand"]),
        ("[dvf]\npoints = 1", vec!["dvf.points: it must be from 100"]),
        ("[dvf]\npoint = 1", vec!["dvf.point: there is no such setting", "dvf.points"]),
        ("[what]\never = 1", vec!["what.ever: there is no such setting"]),
        ("denoise = 2", vec!["denoise: there is no '2'; known: on, off"]),
        ("frames = 3\nspp =", vec!["line 2"]),
    ] {
        let error = Settings::from_toml(text).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)) && !error.contains('\n'), "{text}: {error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file: PathBuf = folder.path().join("f.toml");
    let read = |settings: &mut Settings| format!("{:#}", file::read_file(settings, &file).unwrap_err());
    assert!(read(&mut Settings::default()).contains("f.toml"));
    std::fs::write(&file, "frames = 0").unwrap();
    let error = read(&mut Settings::default());
    assert!(error.contains("f.toml") && error.contains("frames"), "{error}");
}

#[test]
fn settings_that_do_not_go_together_are_refused() {
    let why = |settings: Settings| settings.check().map_err(|error| error.to_string());
    assert_eq!(why(Settings::default()), Ok(()));
    let both = Settings { taa: true, aov: true, ..Settings::default() };
    assert!(why(both).unwrap_err().contains("--taa"));
    let of = |schedule, without: &str| {
        let mut settings = Settings { schedule, ..Settings::default() };
        settings.set("without", without).unwrap();
        why(settings)
    };
    for (schedule, without, part) in [
        (Schedule::Plain, "requery", "chc, demand or auto"),
        (Schedule::Demand, "by-tile", "chc or auto"),
        (Schedule::Chc, "pull-up", "--fronts on"),
    ] {
        assert!(of(schedule, without).unwrap_err().contains(part), "{without}");
    }
    for (schedule, without) in
        [(Schedule::Demand, "requery"), (Schedule::Chc, "by-tile"), (Schedule::Auto, "front-to-back")]
    {
        assert_eq!(of(schedule, without), Ok(()));
    }
    for options in [
        "--secondary ao=roma",
        "--fronts on",
        "--frame-budget 1M",
        "--checkpoints 1 --reference a.exr",
        "--progressive",
        "--measure-error",
    ] {
        let of = |more: &str| why(Settings::from_options(&format!("{options} {more}")).unwrap());
        let option = options.split(' ').next().unwrap();
        assert!(of("--bands 2").unwrap_err().contains(&format!("--bands 2: {option}")), "{options}");
        assert_eq!(of("--bands 1"), Ok(()), "{options}");
    }
    assert_eq!(why(Settings { bands: 9, denoise: true, taa: true, ..Settings::default() }), Ok(()));
    let on = Settings { without: vec![crate::schedule::Optimisation::Requery], ..Settings::default() }.optimisations();
    assert!(!on.requery && on.nearest_first);
}

#[test]
fn the_options_page_is_that_of_the_settings() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/options.md");
    let page = options_page::<Settings>();
    assert!(page.lines().all(|line| line.chars().count() <= 120));
    if std::env::var_os("BRICKWALK_WRITE_OPTIONS").is_some() {
        std::fs::write(file, &page).unwrap();
    }
    let found = std::fs::read_to_string(file).unwrap_or_default();
    assert!(found == page, "docs/options.md is out of date; BRICKWALK_WRITE_OPTIONS=1 writes it anew");
}

#[test]
fn settings_without_effect_are_named() {
    let named = |options: &str| Settings::from_options(options).unwrap().without_effect();
    assert_eq!(named("--quality exact --ao-length 2"), ["--ao-length has no effect without --effects ao"]);
    assert_eq!(named("--roma-k 8 --dvf-rays 64").len(), 2);
    assert!(named("--effects ao --ao-length 2 --secondary roma --roma-k 8").is_empty());
    // `--bom` is of two methods.
    assert!(named("--effects ao --secondary df --bom raster").is_empty() && named("--bom raster").len() == 1);
    assert_eq!(named("--effects ao --secondary ao=roma --roma-shadow-k 4").len(), 1);
    // The sun is traced unless its method is named.
    let [line] = &named("--effects shadow --secondary roma")[..] else { panic!() };
    assert!(line.contains("ao or diffuse") && line.contains("shadow=roma"), "{line}");
    assert!(named("--effects shadow --secondary shadow=roma --roma-shadow-k 4").is_empty());
    assert!(named("--effects ao,diffuse --secondary ao=roma").is_empty());
    assert_eq!(named("--effects shadow,diffuse --secondary ao=sift,diffuse=roma"), Vec::<String>::new());
    assert!(named("").is_empty() && named("--quality exact").is_empty());
}

#[test]
fn videos_are_named_as_what_they_are() {
    let checked = |options: &str| Settings::from_options(options).unwrap().check();
    assert!(checked("--video a.y4m").is_ok());
    for bad in ["--video a.mp4", "--video a"] {
        assert!(checked(bad).unwrap_err().to_string().contains("a.y4m"), "{bad}");
    }
}

#[test]
fn what_is_given_comes_back() {
    for options in ["", "--quality high --spp 4", "--denoise --cache 64M --sun 1,2,3 --dvf-points 1200 --hide a,b"] {
        let settings = Settings::from_options(options).unwrap();
        let text = settings.to_given_toml();
        assert_eq!(Settings::from_toml(&text), Ok(settings), "{text}");
        assert_eq!(text.is_empty(), options.is_empty());
    }
}
