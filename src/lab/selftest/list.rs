//! The cases by their numbers.

use super::boxes::Kind;
use super::case::Source::{Analytic, Exact, Paths, Reference, Unit};
use super::case::{Case, Checks, Source};
use super::lab::Lab;
use super::{
    boxes, fields, histories, lights, maps, meshes, roma, samples, shapes, streaming, surfaces, views, visibility,
};
use anyhow::Result;
use brickwalk_scenes::Stiff;

const fn case(number: u32, title: &'static str, truth: Source, run: fn(&mut Lab, &mut Checks) -> Result<()>) -> Case {
    Case { number, title, truth, run: Some(run) }
}

/// All sixty.
pub const CASES: &[Case] = &[
    case(1, "scene at 10^7 m", Paths, far_origin),
    case(2, "edges shared by two bricks", Exact, meshes::cuts),
    case(3, "sizes from 10^-4 to 10^6 in one scene", Reference, meshes::scale_mix),
    case(4, "scales from 10^-12 to 10^12", Paths, meshes::scale_sweep),
    case(5, "slivers, aspect 10^8", Exact, meshes::slivers),
    case(6, "zero area", Unit, shapes::zero_area),
    case(7, "vertices that are not finite", Unit, shapes::not_finite),
    case(8, "denormals", Paths, meshes::denormals),
    case(9, "overflow near 10^38", Unit, shapes::overflow),
    case(10, "coincident triangles", Paths, shapes::coincident),
    case(11, "all centroids equal", Unit, |lab, checks| {
        shapes::build_and_judge(lab, checks, Stiff::EqualCentroids, 300, 40, 2000.0)
    }),
    case(12, "a million duplicates", Unit, shapes::duplicates),
    case(13, "triangles that span every brick", Reference, |lab, checks| {
        shapes::build_and_judge(lab, checks, Stiff::Spanning, 4000, 128, 30.0)
    }),
    case(14, "a geometric series, very deep trees", Reference, |lab, checks| {
        shapes::build_and_judge(lab, checks, Stiff::Series, 1000, 1000, 500.0)
    }),
    case(15, "zero component of the direction", Exact, |lab, checks| boxes::nodes(lab, checks, Kind::Zero)),
    case(16, "origin on a face, parallel to it", Exact, |lab, checks| boxes::nodes(lab, checks, Kind::OnFace)),
    case(17, "huge reciprocals", Exact, |lab, checks| boxes::nodes(lab, checks, Kind::Tiny)),
    case(18, "flat boxes", Exact, |lab, checks| boxes::nodes(lab, checks, Kind::Flat)),
    case(19, "rounding of slabs", Exact, |lab, checks| boxes::nodes(lab, checks, Kind::Any)),
    case(20, "edges and vertices of closed meshes", Exact, meshes::edges),
    case(21, "origins on surfaces", Analytic, surfaces::leaving_rays),
    case(22, "offset of origins", Exact, surfaces::offsets),
    case(23, "rays that graze at 10^-7 rad", Reference, meshes::grazing),
    case(24, "directions of no length, and of any", Unit, views::directions),
    case(25, "t_min above t_max, t_max = inf", Unit, views::intervals),
    case(26, "camera inside of geometry and boxes", Reference, surfaces::inside),
    case(27, "up along the view", Unit, views::up_along_view),
    case(28, "fields of view of 10^-6 and 179.99 degrees", Unit, views::fields_of_view),
    case(29, "pictures of 1 x 1 and 1 x N", Paths, |lab, checks| {
        views::odd_sizes(lab, checks, &[(1, 1), (1, 37), (37, 1)], &[8, 64])
    }),
    case(30, "tiles that do not divide the picture", Paths, |lab, checks| {
        views::odd_sizes(lab, checks, &[(33, 17), (65, 40)], &[8, 16, 32])
    }),
    case(31, "fronts partition pixels and bricks", Paths, streaming::fronts),
    case(32, "a cut of the camera", Paths, streaming::cut),
    case(33, "late and lost results of queries", Paths, streaming::late_queries),
    case(34, "lists that overflow", Paths, streaming::overflow),
    case(35, "caches of two bricks and less", Paths, streaming::least_cache),
    case(36, "truncated and damaged bricks", Unit, streaming::damage),
    case(37, "more than 2^31 indices or bytes", Unit, streaming::large_counts),
    case(38, "empty scene, one triangle, one brick", Analytic, shapes::least_scenes),
    case(39, "occupancy: planes on borders of cells", Exact, maps::on_borders),
    case(40, "occupancy: planes along an axis", Exact, maps::along_axes),
    case(41, "ROMA: t = 0, 31, 32, where words join", Reference, roma::bits),
    case(42, "ROMA: origin outside, ray that leaves", Reference, roma::leaving),
    case(43, "flat scene", Unit, shapes::flat_scene),
    case(44, "concentric map: centre, diagonals, border", Analytic, maps::concentric),
    case(45, "octahedral map: seams, zeros of either sign", Analytic, maps::octahedral),
    case(46, "ends of the Hammersley set, root of -eps", Unit, maps::hammersley_ends),
    case(47, "DVF: empty cell, point on a face", Unit, visibility::unknown),
    case(48, "prefix sum over 3M areas from 10^-12 to 10^6", Reference, visibility::prefix_sums),
    case(49, "spherical harmonics of a delta light", Analytic, visibility::delta_light),
    case(50, "texel of the sun, 10^6", Analytic, lights::sun_texel),
    case(51, "E_all - E_occ in a closed box", Analytic, visibility::closed_box),
    case(52, "NaN in the history", Unit, histories::not_a_number),
    case(53, "running variance: mean 10^8, sigma 1", Analytic, histories::running_variance),
    case(54, "10^6 accumulated frames", Analytic, samples::accumulation),
    case(55, "albedo 0", Analytic, surfaces::black),
    case(56, "distances in f16", Reference, maps::distances),
    case(57, "jump flooding without a seed", Unit, maps::no_seed),
    case(58, "displacement field: inside, tangent, miss", Analytic, fields::displacement),
    case(59, "uneven scale of instances", Reference, meshes::instances),
    case(60, "ten runs", Paths, views::ten_runs),
];

/// Case 1: rays, then pictures.
fn far_origin(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    meshes::far_origin(lab, checks)?;
    views::far_city(lab, checks)
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_case_is_there_once() {
        assert!(super::CASES.iter().map(|case| case.number).eq(1..=60));
    }
}
