//! Types of settings that are no plain numbers.

use super::names::names;
use super::sizes::{CacheSize, ErrorLimit, FrameBudget, HostCacheSize, ImageSize};
use super::value::{Plain, Rule, Value, value_of_text};
use glam::DVec3;
use std::convert::Infallible;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

names! {
    /// How the bricks to intersect are found.
    Schedule {
        /// Tiles against the top level; loads what rays need.
        Chc = "chc",
        /// One traversal per ray over what is resident; loads what rays ask for.
        Demand = "demand",
        /// Everything resident, one traversal per ray.
        Plain = "plain",
        /// The same over binary trees: a baseline.
        #[cfg(feature = "lab")]
        PlainBinary = "plain-bvh2",
        /// The cheapest of the first three, pass by pass.
        Auto = "auto",
    }
}

impl Schedule {
    /// Whether it keeps everything resident.
    pub fn is_plain(self) -> bool {
        !matches!(self, Self::Chc | Self::Demand | Self::Auto)
    }
}

names! {
    /// What is overwritten when the cache is full.
    Policy {
        /// Write at the next position, wrap, evict what is overlapped (the paper's cache).
        RoundRobin = "round-robin",
        /// Round robin that passes over once what was used, and stays in place where a cycle of requests does not fit.
        SecondChance = "second-chance",
        /// Evict what was not used for longest.
        Lru = "lru",
    }
}

names! {
    /// A pass.
    Effect {
        /// Rays of the camera.
        Primary = "primary",
        /// Rays towards the lamps.
        Shadow = "shadow",
        /// Short rays around the normal.
        Ao = "ao",
        /// Rays around the normal whose hits are shaded.
        Diffuse = "diffuse",
        /// Rays drawn by the gloss of surfaces, whose hits are shaded.
        Glossy = "glossy",
        /// Rays towards the environment.
        Environment = "environment",
        /// All light, reflected again and again.
        Path = "path",
    }
}

/// The passes of a frame; primary rays are always among them, as every other pass starts where they end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EffectList {
    /// Rays towards the lamps.
    pub shadow: bool,
    /// Ambient occlusion.
    pub ao: bool,
    /// Diffuse interreflection.
    pub diffuse: bool,
    /// Reflections by the gloss of surfaces.
    pub glossy: bool,
    /// Rays towards the environment.
    pub environment: bool,
    /// All of these but `ao`, and as many bounces as [`Bounces::Auto`] has then.
    pub path: bool,
}

impl EffectList {
    /// Primary rays alone.
    pub const PRIMARY: Self =
        Self { shadow: false, ao: false, diffuse: false, glossy: false, environment: false, path: false };
    /// Primary rays and shadows.
    pub const SHADOW: Self = Self { shadow: true, ..Self::PRIMARY };
    /// Primary rays, shadows, and ambient occlusion.
    pub const LIT: Self = Self { ao: true, ..Self::SHADOW };

    /// Primary rays and these.
    pub fn of(effects: &[Effect]) -> Self {
        let has = |effect| effects.contains(&effect);
        let path = has(Effect::Path);
        Self {
            shadow: path || has(Effect::Shadow),
            ao: has(Effect::Ao),
            diffuse: path || has(Effect::Diffuse),
            glossy: path || has(Effect::Glossy),
            environment: path || has(Effect::Environment),
            path,
        }
    }

    fn list(self) -> Vec<Effect> {
        let all = [
            (true, Effect::Primary),
            (self.shadow && !self.path, Effect::Shadow),
            (self.ao, Effect::Ao),
            (self.diffuse && !self.path, Effect::Diffuse),
            (self.glossy && !self.path, Effect::Glossy),
            (self.environment && !self.path, Effect::Environment),
            (self.path, Effect::Path),
        ];
        all.into_iter().filter(|(is_on, _)| *is_on).map(|(_, effect)| effect).collect()
    }
}

impl fmt::Display for EffectList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.list().plain().to_string())
    }
}

impl Value for EffectList {
    const NAMES: &'static [&'static str] = Effect::NAMES;

    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        Ok(Self::of(&Vec::<Effect>::read(text, rule, unit)?))
    }

    fn plain(&self) -> Plain {
        self.list().plain()
    }
}

/// A direction: three finite numbers, not all 0, as they were given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction(pub [f64; 3]);

impl Direction {
    /// The unit vector.
    pub fn unit(self) -> DVec3 {
        self.normalized().unwrap_or(DVec3::Y)
    }

    fn normalized(self) -> Option<DVec3> {
        let v = DVec3::from(self.0);
        // Scaled first, so that neither large nor small numbers leave the range when squared.
        (v / v.abs().max_element()).try_normalize()
    }
}

impl FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = numbers(text).map(Self).filter(|direction| direction.normalized().is_some());
        found.ok_or_else(|| "a direction is three numbers X,Y,Z, not all 0, as in 0.4,0.8,0.45".into())
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}", self.0[0], self.0[1], self.0[2])
    }
}

/// So many finite numbers with commas between them.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    let numbers = numbers.iter().all(|number| number.is_finite()).then_some(numbers)?;
    numbers.try_into().ok()
}

/// A corner and two edges that span an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// The corner, world space.
    pub corner: DVec3,
    /// The edges that start there.
    pub edges: [DVec3; 2],
}

impl FromStr for Rectangle {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let values = numbers::<9>(text).filter(|values| values.iter().all(|value| value.abs() <= 1e9));
        let values = values.ok_or("it must be nine numbers within 1e9: a corner, an edge, an edge")?;
        let [corner, u, v] = [0, 3, 6].map(|at| DVec3::new(values[at], values[at + 1], values[at + 2]));
        let is_area = u.cross(v).length() > 1e-12;
        if is_area { Ok(Self { corner, edges: [u, v] }) } else { Err("its edges must span an area".into()) }
    }
}

impl fmt::Display for Rectangle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = [self.corner, self.edges[0], self.edges[1]].map(|v| Direction(v.to_array()).to_string());
        f.write_str(&all.join(","))
    }
}

/// A plane that a scene is cut at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of it, world space.
    pub point: DVec3,
    /// Unit normal; what lies on the side that it points to is cut away.
    pub normal: Direction,
}

impl FromStr for Plane {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let values = numbers::<6>(text).filter(|values| values[..3].iter().all(|value| value.abs() <= 1e9));
        let values = values.ok_or("it must be six numbers: a point within 1e9, a normal")?;
        let normal = Direction([values[3], values[4], values[5]]);
        let normal = normal.normalized().map(|_| normal).ok_or("its normal must have a length")?;
        Ok(Self { point: DVec3::new(values[0], values[1], values[2]), normal })
    }
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", Direction(self.point.to_array()), self.normal)
    }
}

/// Three numbers, six, and nine, are lists in files.
macro_rules! value_of_numbers {
    ($($name:ty),*) => { $(
        impl Value for $name {
            const IS_SIGNED: bool = true;

            fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
                text.parse()
            }

            fn plain(&self) -> Plain {
                Plain::List(self.to_string().split(',').filter_map(|x| x.parse().ok()).map(Plain::Real).collect())
            }
        }
    )* };
}

value_of_numbers!(Direction, Plane, Rectangle);

/// Degrees of a random turn, 0 to 360; `full` is all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn(pub f32);

impl Turn {
    /// Any turn, and any height above the surface.
    pub const FULL: Self = Self(360.0);
}

impl Value for Turn {
    fn read(text: &str, rule: Rule, _: &str) -> Result<Self, String> {
        if text == "full" { Ok(Self::FULL) } else { f32::read(text, rule, "degrees, or full").map(Self) }
    }

    fn plain(&self) -> Plain {
        self.0.plain()
    }
}

/// A length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// What suits the scene.
    Auto,
    /// In world units.
    World(f64),
}

impl Value for Length {
    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        match text {
            AUTO => Ok(Self::Auto),
            text => f64::read(text, rule, unit).map(Self::World).map_err(|why| format!("{why}, or auto")),
        }
    }

    fn plain(&self) -> Plain {
        match self {
            Self::Auto => Plain::Text(AUTO.into()),
            Self::World(length) => length.plain(),
        }
    }
}

/// Times that light is reflected between surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bounces {
    /// [`Bounces::OF_PATHS`] where the effects have `path`, else one.
    Auto,
    /// So many.
    Count(u32),
}

impl Bounces {
    /// Those of `--effects path`.
    pub const OF_PATHS: u32 = 8;

    /// With these effects.
    pub fn of(self, effects: EffectList) -> u32 {
        match self {
            Self::Auto if effects.path => Self::OF_PATHS,
            Self::Auto => 1,
            Self::Count(count) => count,
        }
    }
}

impl Value for Bounces {
    fn read(text: &str, rule: Rule, unit: &str) -> Result<Self, String> {
        match text {
            AUTO => Ok(Self::Auto),
            text => u32::read(text, rule, unit).map(Self::Count).map_err(|why| format!("{why}, or auto")),
        }
    }

    fn plain(&self) -> Plain {
        match self {
            Self::Auto => Plain::Text(AUTO.into()),
            Self::Count(count) => count.plain(),
        }
    }
}

/// What surrounds a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Environment {
    /// A physical sky, or nothing where a scene has a light of its own.
    Auto,
    /// A physical sky.
    Sky,
    /// An image.
    File(PathBuf),
}

impl FromStr for Environment {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            AUTO => Self::Auto,
            "sky" => Self::Sky,
            file => Self::File(file.into()),
        })
    }
}

impl fmt::Display for Environment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str(AUTO),
            Self::Sky => f.write_str("sky"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// What is left to the scene or the machine.
const AUTO: &str = "auto";
/// The name of the processor among the adapters.
const CPU: &str = "cpu";

/// What renders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Adapter {
    /// A hardware GPU if there is one, else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// The graphics adapter whose name contains this, in any case.
    Named(String),
}

impl FromStr for Adapter {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            AUTO => Self::Auto,
            CPU => Self::Cpu,
            name => Self::Named(name.into()),
        })
    }
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => AUTO,
            Self::Cpu => CPU,
            Self::Named(name) => name,
        })
    }
}

value_of_text!(CacheSize, ErrorLimit, FrameBudget, HostCacheSize, ImageSize, Environment, Adapter; false);

#[cfg(test)]
mod tests {
    use super::*;

    fn read<T: Value>(text: &str) -> Result<T, String> {
        T::read(text, Rule::Any, "")
    }

    #[test]
    fn effects_are_read_and_written_alike() {
        for text in ["primary", "primary,shadow", "primary,ao", "primary,shadow,ao,diffuse,glossy,environment"] {
            assert_eq!(read::<EffectList>(text).unwrap().to_string(), text);
        }
        assert_eq!(read::<EffectList>("ao").unwrap().to_string(), "primary,ao");
        assert!(read::<EffectList>("glow").is_err() && read::<EffectList>("").is_err());
    }

    #[test]
    fn directions_are_kept_as_given() {
        let direction: Direction = "3,0,-4".parse().unwrap();
        let [x, y, z] = direction.unit().to_array();
        assert!((x - 0.6).abs() < 1e-15 && y == 0.0 && (z + 0.8).abs() < 1e-15);
        assert_eq!(direction.plain().to_string(), "3,0,-4");
        let large: Direction = "1e300, 1e300, 0".parse().unwrap();
        assert!((large.unit().x - 0.5f64.sqrt()).abs() < 1e-15);
        for bad in ["", "0,0,0", "1,2", "1,2,3,4", "1,2,x", "nan,0,1", "inf,0,0", "1,2,3,"] {
            assert!(bad.parse::<Direction>().is_err(), "{bad}");
        }
    }

    #[test]
    fn rectangles_span_an_area() {
        let rectangle: Rectangle = "0,0,0,1,0,0,0,0,1".parse().unwrap();
        assert_eq!(rectangle.plain().to_string().parse(), Ok(rectangle));
        for bad in ["0,0,0,1,0,0,2,0,0", "0,0,0,1,0,0", "0,0,0,1,0,0,0,0,x", "0,0,0,1,0,0,0,0,inf", ""] {
            assert!(bad.parse::<Rectangle>().is_err(), "{bad}");
        }
    }

    #[test]
    fn lengths_are_left_to_the_scene_or_stated() {
        let rule = Rule::Real(1e-6, 1e9);
        for (text, length) in [("auto", Length::Auto), ("0.5", Length::World(0.5))] {
            assert_eq!(Length::read(text, rule, ""), Ok(length));
            assert_eq!(length.plain().to_string(), text);
        }
        assert!(Length::read("0", rule, "").unwrap_err().ends_with("or auto"));
    }

    #[test]
    fn paths_are_all_effects_and_eight_bounces() {
        let list = |text| EffectList::read(text, Rule::Any, "").unwrap();
        let (path, one) = (list("path"), list("primary,diffuse"));
        assert!(path.shadow && path.diffuse && path.glossy && path.environment && !path.ao);
        assert_eq!(path.to_string(), "primary,path");
        assert_eq!(list("primary,path"), path);
        let rule = Rule::Whole(1, 64);
        for (text, of_path, of_one) in [("auto", 8, 1), ("1", 1, 1), ("64", 64, 64)] {
            let bounces = Bounces::read(text, rule, "").unwrap();
            assert_eq!((bounces.of(path), bounces.of(one)), (of_path, of_one));
            assert_eq!(bounces.plain().to_string(), text);
        }
        assert!(Bounces::read("65", rule, "").unwrap_err().ends_with("or auto"));
    }

    #[test]
    fn other_values_are_read_and_written_alike() {
        let rule = Rule::Real(0.0, 360.0);
        assert_eq!(Turn::read("full", rule, ""), Ok(Turn::FULL));
        assert!(Turn::read("361", rule, "").unwrap_err().ends_with("or full"));
        assert!(Turn::read("nan", rule, "").is_err());
        for (text, adapter) in [("auto", Adapter::Auto), ("cpu", Adapter::Cpu), ("llvm", Adapter::Named("llvm".into()))]
        {
            assert_eq!(read(text), Ok(adapter.clone()));
            assert_eq!(adapter.to_string(), text);
        }
    }
}
