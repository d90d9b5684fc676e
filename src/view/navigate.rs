//! How a person moves the camera: by flying, by turning about a point, by going to what was clicked. Plain arithmetic
//! in f64, with no window in it.

use crate::scene::Camera;
use glam::DVec3;

/// Nearest to straight up or down that the camera looks, radians.
const MARGIN: f64 = 1e-3;
/// A flight to what was clicked takes so long, seconds.
const FLIGHT_S: f64 = 0.45;
/// Of the distance to what is looked at, the camera flies so much a second, and with shift.
const SPEED: f64 = 0.9;
const FAST: f64 = 4.0;
/// A step of the wheel brings the camera nearer by this factor.
const WHEEL: f64 = 0.85;
/// What was gone to is seen from so many of its own radii away.
const RADII: f64 = 2.6;

/// Which way the camera flies, each from -1 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thrust {
    /// Forward.
    pub forward: f64,
    /// To the right.
    pub right: f64,
    /// Along the world's up.
    pub up: f64,
    /// Faster.
    pub is_fast: bool,
}

impl Thrust {
    /// Whether the camera stays where it is.
    pub fn is_none(&self) -> bool {
        (self.forward, self.right, self.up) == (0.0, 0.0, 0.0)
    }
}

/// On the way to somewhere.
#[derive(Clone, Copy, Debug)]
struct Flight {
    from: [DVec3; 2],
    to: [DVec3; 2],
    /// Seconds on the way.
    time: f64,
}

/// A camera that a person moves.
#[derive(Clone, Debug)]
pub struct Navigator {
    position: DVec3,
    /// Unit: what is up, and two axes across.
    up: DVec3,
    north: DVec3,
    east: DVec3,
    /// Turn from north to east, and above the horizon, radians.
    yaw: f64,
    pitch: f64,
    fov_y: f64,
    /// Distance to what is looked at, world units, above 0: how fast the camera flies.
    reach: f64,
    /// The least and the greatest of these distances.
    range: [f64; 2],
    flight: Option<Flight>,
    /// The camera: what was put there, to the last bit, or where it has been moved since.
    camera: Camera,
}

impl Navigator {
    /// Where `camera` is, in a scene whose diagonal is so long.
    pub fn new(camera: &Camera, diagonal: f64) -> Self {
        let diagonal = if diagonal.is_finite() && diagonal > 0.0 { diagonal } else { 1.0 };
        let up = camera.up.try_normalize().unwrap_or(DVec3::Y);
        let (north, east) = up.any_orthonormal_pair();
        let (_, _, forward) = camera.frame();
        let mut own = Self {
            position: camera.position,
            up,
            north,
            east,
            yaw: 0.0,
            pitch: 0.0,
            fov_y: camera.fov_y,
            reach: 0.1 * diagonal,
            range: [1e-6 * diagonal, 2.0 * diagonal],
            flight: None,
            camera: *camera,
        };
        own.face(forward);
        own.set_reach((camera.target - camera.position).length());
        own
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Where it has been moved to.
    fn moved(&mut self) {
        let target = self.position + self.forward() * self.reach;
        self.camera = Camera { position: self.position, target, up: self.up, fov_y: self.fov_y };
    }

    /// Puts the camera there.
    pub fn put(&mut self, camera: &Camera) {
        let (_, _, forward) = camera.frame();
        (self.position, self.fov_y, self.flight) = (camera.position, camera.fov_y, None);
        self.face(forward);
        self.camera = Camera { up: self.up, ..*camera };
    }

    /// The vertical field of view, radians.
    pub fn set_fov_y(&mut self, fov_y: f64) {
        self.fov_y = fov_y;
        self.camera.fov_y = fov_y;
    }

    /// How far away what is looked at is, world units.
    pub fn set_reach(&mut self, distance: f64) {
        if distance.is_finite() {
            self.reach = distance.clamp(self.range[0], self.range[1]);
        }
    }

    /// Distance to what is looked at, world units.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Whether it moves by itself.
    pub fn is_in_flight(&self) -> bool {
        self.flight.is_some()
    }

    /// Where it looks, unit.
    pub fn forward(&self) -> DVec3 {
        let level = self.north * self.yaw.cos() + self.east * self.yaw.sin();
        level * self.pitch.cos() + self.up * self.pitch.sin()
    }

    fn face(&mut self, forward: DVec3) {
        let limit = std::f64::consts::FRAC_PI_2 - MARGIN;
        self.pitch = forward.dot(self.up).clamp(-1.0, 1.0).asin().clamp(-limit, limit);
        let (north, east) = (forward.dot(self.north), forward.dot(self.east));
        if north.hypot(east) > 1e-9 {
            self.yaw = east.atan2(north);
        }
    }

    /// Turns the camera where it is: to the right and up, radians.
    pub fn look(&mut self, right: f64, up: f64) {
        self.flight = None;
        // Right of forward is forward x up.
        let sign = self.north.cross(self.up).dot(self.east).signum();
        let limit = std::f64::consts::FRAC_PI_2 - MARGIN;
        self.yaw = (self.yaw + sign * right) % std::f64::consts::TAU;
        self.pitch = (self.pitch + up).clamp(-limit, limit);
        self.moved();
    }

    /// Turns the camera about `pivot`, which stays where it is in the picture: radians.
    pub fn orbit(&mut self, pivot: DVec3, right: f64, up: f64) {
        let of = |own: &Self| {
            let forward = own.forward();
            let side = forward.cross(own.up).normalize();
            [forward, side, side.cross(forward)]
        };
        let before = of(self);
        let offset = pivot - self.position;
        let along = before.map(|axis| offset.dot(axis));
        self.look(right, up);
        let after = of(self);
        self.position = pivot - (after[0] * along[0] + after[1] * along[1] + after[2] * along[2]);
        self.moved();
    }

    /// Nearer to `point`, or for negative `steps` farther away.
    pub fn dolly(&mut self, point: DVec3, steps: f64) {
        self.flight = None;
        let factor = WHEEL.powf(steps.clamp(-20.0, 20.0));
        let to = (point - self.position) * factor;
        let least = self.range[0];
        if to.is_finite() && to.length() >= least {
            self.position = point - to;
            self.set_reach(self.reach * factor);
            self.moved();
        }
    }

    /// Sets out for a point on a surface, of which so much is to be seen: a radius, world units.
    pub fn go_to(&mut self, point: DVec3, radius: f64) {
        let away = (RADII * radius / (0.5 * self.fov_y).tan().clamp(0.05, 20.0)).clamp(self.range[0], self.range[1]);
        let from = (self.position - point).try_normalize().unwrap_or(-self.forward());
        let to = [point + from * away, point];
        self.flight =
            Some(Flight { from: [self.position, self.position + self.forward() * self.reach], to, time: 0.0 });
    }

    /// Moves on by `seconds`. Whether the camera has moved.
    pub fn advance(&mut self, thrust: Thrust, seconds: f64) -> bool {
        let seconds = seconds.clamp(0.0, 0.25);
        if !thrust.is_none() {
            self.flight = None;
            let forward = self.forward();
            let right = forward.cross(self.up).normalize();
            let way = forward * thrust.forward + right * thrust.right + self.up * thrust.up;
            let speed = self.reach * SPEED * if thrust.is_fast { FAST } else { 1.0 };
            self.position += way.clamp_length_max(1.0) * speed * seconds;
            self.moved();
            return true;
        }
        let Some(flight) = &mut self.flight else { return false };
        flight.time += seconds;
        let Flight { from, to, time } = *flight;
        let x = (time / FLIGHT_S).min(1.0);
        let share = x * x * (3.0 - 2.0 * x);
        let [position, target] = [0, 1].map(|k| from[k].lerp(to[k], share));
        if x >= 1.0 {
            self.flight = None;
        }
        self.position = position;
        let view = target - position;
        if let Some(forward) = view.try_normalize() {
            self.face(forward);
            self.set_reach(view.length());
        }
        self.moved();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn navigator(position: [f64; 3], target: [f64; 3], up: [f64; 3]) -> Navigator {
        let camera = Camera { position: position.into(), target: target.into(), up: up.into(), fov_y: 1.0 };
        Navigator::new(&camera, 100.0)
    }

    #[test]
    fn it_begins_where_the_camera_is() {
        for (target, up) in [([3.0, 1.0, -9.0], [0.0, 1.0, 0.0]), ([0.0, 4.0, 9.0], [0.0, 0.0, 2.0])] {
            let mut own = navigator([1.0, 2.0, 3.0], target, up);
            let camera = own.camera();
            // To the last bit; once it has been moved, nearly.
            assert_eq!((camera.position, camera.target), (DVec3::new(1.0, 2.0, 3.0), DVec3::from_array(target)));
            own.set_reach(99.0);
            assert_eq!(own.camera(), camera, "what is seen is no motion");
            own.set_reach((camera.target - camera.position).length());
            own.look(0.0, 0.0);
            assert!((own.camera().target - DVec3::from_array(target)).length() < 1e-9, "{camera:?}");
        }
        // Straight down it keeps off by the margin, and stays a camera.
        let mut down = navigator([0.0, 9.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]);
        down.look(0.0, 0.0);
        assert!(down.camera().check().is_ok() && down.camera().target.length() < 0.02, "{down:?}");
    }

    #[test]
    fn right_is_right_and_up_is_up() {
        for up in [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]] {
            let target = [0.3, -0.2, 0.1].map(|x: f64| x + 5.0);
            let mut own = navigator([0.0; 3], target, up);
            let (right, above, forward) = own.camera().frame();
            own.look(0.1, 0.0);
            assert!(own.forward().dot(right) > 0.05, "{up:?}");
            own.look(-0.1, 0.1);
            assert!(own.forward().dot(above) > 0.09 && own.forward().dot(right).abs() < 1e-9);
            own.look(0.0, -0.1);
            let before = own.position;
            assert!(own.advance(Thrust { right: 1.0, ..Thrust::default() }, 0.1));
            assert!((own.position - before).normalize().dot(right) > 0.999);
            own.advance(Thrust { right: -1.0, ..Thrust::default() }, 0.1);
            own.advance(Thrust { forward: 1.0, ..Thrust::default() }, 0.1);
            assert!((own.position - before).normalize().dot(forward) > 0.999);
        }
    }

    #[test]
    fn a_pivot_stays_where_it_is_in_the_picture() {
        let mut own = navigator([0.0, 1.0, 8.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let pivot = DVec3::new(1.0, 0.5, 1.0);
        let shown = |own: &Navigator| {
            let (right, up, forward) = own.camera().frame();
            let way = pivot - own.position;
            DVec3::new(way.dot(right), way.dot(up), way.dot(forward))
        };
        let before = shown(&own);
        for _ in 0..40 {
            own.orbit(pivot, 0.17, 0.02);
            assert!((shown(&own) - before).length() < 1e-9);
        }
        assert!((own.position - DVec3::new(0.0, 1.0, 8.0)).length() > 0.1);
    }

    #[test]
    fn it_arrives_where_it_was_sent() {
        let mut own = navigator([0.0, 1.0, 8.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let point = DVec3::new(3.0, 0.0, -2.0);
        own.go_to(point, 0.5);
        let mut steps = 0;
        while own.advance(Thrust::default(), 0.05) {
            steps += 1;
        }
        assert!((9..=11).contains(&steps), "{steps}");
        assert!((own.camera().target - point).length() < 1e-6);
        assert!((own.position - point).length() < 3.0);
        // Any thrust ends a flight.
        own.go_to(DVec3::ZERO, 0.5);
        own.advance(Thrust { up: 1.0, ..Thrust::default() }, 0.05);
        assert!(!own.is_in_flight());
    }

    #[test]
    fn no_input_makes_a_camera_that_is_none() {
        let mut own = navigator([0.0, 1.0, 8.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        for (k, big) in [1e300, f64::INFINITY, -1e9, 0.0].into_iter().enumerate() {
            own.set_reach(big);
            own.dolly(DVec3::new(0.0, 0.0, -1.0), if k % 2 == 0 { 50.0 } else { -50.0 });
            own.look(7.0, 9.0);
            own.advance(Thrust { forward: 1.0, right: -1.0, up: 1.0, is_fast: true }, 1e6);
            assert!(own.camera().check().is_ok(), "{:?}", own.camera());
        }
    }
}
