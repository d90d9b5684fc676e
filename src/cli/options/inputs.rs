//! The inputs of `convert`, each with the options that belong to it.

use brickwalk_convert::import::{Input, Up, parse_transform};
use clap::builder::ValueParser;
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, value_parser};
use std::path::{Path, PathBuf};

/// Units of length and the metres they stand for.
const UNITS: [(&str, f64); 5] = [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("in", 0.0254), ("ft", 0.3048)];

/// Files and folders with their options, in the order of the command line.
///
/// An option belongs to the input before it; before the first input it belongs to all that have none of their own.
/// `AFTER_FROM`: they are the inputs of a conversion that is repeated, which come after `--from`, and there may be
/// none.
#[derive(Clone, Debug)]
pub struct Inputs<const AFTER_FROM: bool> {
    /// The inputs; a path may be that of a folder.
    pub inputs: Vec<Input>,
}

/// What is converted.
pub type InputArgs = Inputs<false>;

/// What a scene was converted from.
pub type FromArgs = Inputs<true>;

impl<const AFTER_FROM: bool> Args for Inputs<AFTER_FROM> {
    fn augment_args(command: Command) -> Command {
        let option = |id: &'static str, value: &'static str, parser: ValueParser, help: &'static str| {
            Arg::new(id)
                .long(id)
                .value_name(value)
                .value_parser(parser)
                .action(ArgAction::Append)
                .help_heading("Inputs")
                .allow_hyphen_values(id == "transform")
                .help(help)
        };
        let inputs = Arg::new("inputs").value_name("INPUT").num_args(1..).value_parser(value_parser!(PathBuf));
        let inputs = match AFTER_FROM {
            false => inputs.required(true).help(
                "Scene files (.gltf, .glb, .obj, .ply, .stl, tileset.json of 3D Tiles) or folders of them; triangle \
                 ids are numbered in this order. --transform, --scene, --up, --unit and --within apply to the input \
                 before them, or to all inputs if they come first",
            ),
            // It is listed last.
            true => inputs.long("from").action(ArgAction::Append).display_order(999).help(
                "The inputs of the conversion in the same order, with their --transform, --scene, --up, --unit and \
                 --within; give its other options, too [default: generate the scene again, if it was generated]",
            ),
        };
        command
            .arg(inputs)
            .arg(option(
                "transform",
                "STEPS|MATRIX",
                ValueParser::new(parse_transform),
                "Placement of the input: steps in order (translate X Y Z, scale S or scale X Y Z, rotate x|y|z \
                 DEGREES; metres, Y up), as in \"scale 0.5 rotate y 90 translate 10 0 -5\"; or a matrix, 12 or 16 \
                 numbers row by row [default: identity]",
            ))
            .arg(option(
                "scene",
                "NAME|N",
                ValueParser::string(),
                "The scene of a glTF file, by name or number [default: the file's default scene]",
            ))
            .arg(option(
                "up",
                "y|z",
                ValueParser::new(up),
                "The axis that points up in OBJ, PLY and STL files and in tilesets [default: z in tilesets, else y]",
            ))
            .arg(option(
                "unit",
                "UNIT",
                ValueParser::new(unit),
                "The unit of length of OBJ, PLY and STL files: mm, cm, m, in, ft [default: m]",
            ))
            .arg(option(
                "within",
                "DIR",
                value_parser!(PathBuf),
                "A folder around the input: the files that it names are read there and below, and nowhere else, \
                 by symbolic links neither [default: the input's own folder, where links are followed]",
            ))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<const AFTER_FROM: bool> FromArgMatches for Inputs<AFTER_FROM> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let paths = indexed::<PathBuf>(matches, "inputs");
        let starts: Vec<usize> = paths.iter().map(|(at, _)| *at).collect();
        let transforms = assign(&starts, indexed::<[f64; 12]>(matches, "transform"), "transform")?;
        let scenes = assign(&starts, indexed::<String>(matches, "scene"), "scene")?;
        let ups = assign(&starts, indexed::<Up>(matches, "up"), "up")?;
        let units = assign(&starts, indexed::<f64>(matches, "unit"), "unit")?;
        let within = assign(&starts, indexed::<PathBuf>(matches, "within"), "within")?;
        let mut inputs = Vec::with_capacity(paths.len());
        for (i, (_, path)) in paths.into_iter().enumerate() {
            let kind = Kind::of(&path);
            let given = |option: &str, own: bool, fits: bool, remedy: &str| match own && !fits {
                true => Err(usage(format!("--{option} does not apply to {}; {remedy}", path.display()))),
                false => Ok(()),
            };
            let has_scenes = !matches!(kind, Kind::Plain | Kind::Tiles);
            given("scene", scenes.is_own[i], has_scenes, "only glTF files have scenes")?;
            let remedy = "glTF is in metres with Y up; use --transform instead";
            given("up", ups.is_own[i], kind != Kind::Gltf, remedy)?;
            let remedy = if kind == Kind::Tiles { "tilesets are in metres; use --transform instead" } else { remedy };
            given("unit", units.is_own[i], !matches!(kind, Kind::Gltf | Kind::Tiles), remedy)?;
            let mut input = Input::from(path);
            input.transform = transforms.values[i].unwrap_or(input.transform);
            input.scene = scenes.values[i].clone().filter(|_| has_scenes);
            input.up = ups.values[i].filter(|_| kind != Kind::Gltf);
            input.metres = units.values[i].filter(|_| kind != Kind::Tiles).unwrap_or(input.metres);
            input.within = within.values[i].clone();
            inputs.push(input);
        }
        Ok(Self { inputs })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// What an input is, as far as its name tells.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Gltf,
    /// OBJ, PLY, STL.
    Plain,
    /// 3D Tiles.
    Tiles,
    /// A folder, or what the importer will judge.
    Other,
}

impl Kind {
    fn of(path: &Path) -> Self {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            _ if path.is_dir() => Self::Other,
            Some("gltf" | "glb") => Self::Gltf,
            Some("obj" | "ply" | "stl") => Self::Plain,
            Some("json") => Self::Tiles,
            _ => Self::Other,
        }
    }
}

/// The values of an argument with their places on the command line.
fn indexed<T: Clone + Send + Sync + 'static>(matches: &ArgMatches, id: &str) -> Vec<(usize, T)> {
    let places = matches.indices_of(id).into_iter().flatten();
    places.zip(matches.get_many::<T>(id).into_iter().flatten().cloned()).collect()
}

/// For each input the value that belongs to it, and whether it is its own.
struct Assigned<T> {
    values: Vec<Option<T>>,
    is_own: Vec<bool>,
}

fn assign<T: Clone>(starts: &[usize], given: Vec<(usize, T)>, option: &str) -> Result<Assigned<T>, clap::Error> {
    let mut all = None;
    let mut own = vec![None; starts.len()];
    for (at, value) in given {
        let target = match starts.partition_point(|&start| start < at).checked_sub(1) {
            Some(input) => &mut own[input],
            None => &mut all,
        };
        if target.replace(value).is_some() {
            return Err(usage(format!("--{option} is given twice for the same input; give it once")));
        }
    }
    let is_own = own.iter().map(Option::is_some).collect();
    let values = own.into_iter().map(|value| value.or_else(|| all.clone())).collect();
    Ok(Assigned { values, is_own })
}

fn usage(message: String) -> clap::Error {
    clap::Error::raw(ErrorKind::ValueValidation, message + "\n")
}

fn up(text: &str) -> Result<Up, String> {
    match text {
        "y" | "Y" => Ok(Up::Y),
        "z" | "Z" => Ok(Up::Z),
        _ => Err("it must be y or z".into()),
    }
}

fn unit(text: &str) -> Result<f64, String> {
    let known = UNITS.iter().find(|(name, _)| *name == text).map(|(_, metres)| *metres);
    known.ok_or_else(|| "it must be mm, cm, m, in or ft".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &str) -> Result<Vec<Input>, String> {
        let command = InputArgs::augment_args(Command::new("test"));
        let words = arguments.split('|').map(str::trim);
        let matches = command.try_get_matches_from(std::iter::once("test").chain(words)).map_err(|e| e.to_string())?;
        InputArgs::from_arg_matches(&matches).map(|args| args.inputs).map_err(|e| e.to_string())
    }

    #[test]
    fn options_belong_to_the_input_before_them() {
        let inputs = parse(
            "--unit|mm|a.stl|--up|z|b.glb|--transform|-1 0 0 4  0 1 0 0  0 0 1 0|--scene|2|c.ply|--unit|ft|--within|d",
        );
        let [a, b, c] = &inputs.unwrap()[..] else { panic!() };
        assert_eq!((a.up, a.metres, a.transform[3]), (Some(Up::Z), 0.001, 0.0));
        assert_eq!((b.up, b.scene.as_deref(), b.transform[3]), (None, Some("2"), 4.0));
        assert_eq!((c.up, c.metres, c.scene.as_deref()), (None, 0.3048, None));
        assert_eq!((&a.within, &b.within, c.within.as_deref()), (&None, &None, Some(Path::new("d"))));
    }

    #[test]
    fn options_before_the_first_input_belong_to_all() {
        let inputs = parse("--up|z|--transform|translate 1 2 3|--scene|x|a.obj|b.gltf|--transform|scale 2").unwrap();
        assert_eq!((inputs[0].transform[3], inputs[1].transform[3]), (1.0, 0.0));
        assert_eq!(
            (inputs[0].up, inputs[0].scene.as_deref(), inputs[1].scene.as_deref()),
            (Some(Up::Z), None, Some("x"))
        );
    }

    #[test]
    fn what_does_not_belong_is_usage() {
        for (arguments, expected) in [
            ("a.glb|--up|z", "--up does not apply to a.glb"),
            ("a.glb|--unit|mm", "use --transform"),
            ("a.stl|--scene|1", "--scene does not apply to a.stl"),
            ("a.stl|--up|z|--up|y", "given twice"),
            ("a.stl|--up|x", "must be y or z"),
            ("tileset.json|--scene|1", "--scene does not apply to tileset.json"),
            ("tileset.json|--unit|mm", "tilesets are in metres"),
            ("a.stl|--unit|km", "mm, cm, m, in or ft"),
            ("a.stl|--transform|sideways", "cannot read"),
        ] {
            let error = parse(arguments).unwrap_err();
            assert!(error.contains(expected), "{arguments}: {error}");
        }
    }
}
