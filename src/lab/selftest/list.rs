//! The cases by their numbers.

use super::case::Source::{Analytic, Exact, Paths, Reference, Unit};
use super::case::{Case, Checks, Source};
use super::lab::Lab;
use super::{boxes, histories, lights, maps, meshes, roma, samples, shapes, streaming, surfaces, views, visibility};
use anyhow::Result;

const fn case(number: u32, title: &'static str, truth: Source, run: fn(&mut Lab) -> Result<Checks>) -> Case {
    Case { number, title, truth, run: Some(run) }
}

const fn later(number: u32, title: &'static str, truth: Source) -> Case {
    Case { number, title, truth, run: None }
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
    case(11, "all centroids equal", Unit, shapes::equal_centroids),
    case(12, "a million duplicates", Unit, shapes::duplicates),
    case(13, "triangles that span every brick", Reference, shapes::spanning),
    case(14, "a geometric series, very deep trees", Reference, shapes::series),
    case(15, "zero component of the direction", Exact, boxes::zero_components),
    case(16, "origin on a face, parallel to it", Exact, boxes::on_faces),
    case(17, "huge reciprocals", Exact, boxes::huge_reciprocals),
    case(18, "flat boxes", Exact, boxes::flat),
    case(19, "rounding of slabs", Exact, boxes::rounding),
    case(20, "edges and vertices of closed meshes", Exact, meshes::edges),
    case(21, "origins on surfaces", Analytic, surfaces::leaving_rays),
    case(22, "offset of origins", Exact, surfaces::offsets),
    case(23, "rays that graze at 10^-7 rad", Reference, meshes::grazing),
    case(24, "directions of no length, and of any", Unit, views::directions),
    case(25, "t_min above t_max, t_max = inf", Unit, views::intervals),
    case(26, "camera inside of geometry and boxes", Reference, surfaces::inside),
    case(27, "up along the view", Unit, views::up_along_view),
    case(28, "fields of view of 10^-6 and 179.99 degrees", Unit, views::fields_of_view),
    case(29, "pictures of 1 x 1 and 1 x N", Paths, views::least_pictures),
    case(30, "tiles that do not divide the picture", Paths, views::tile_remainder),
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
    later(58, "displacement field: inside, tangent, miss", Analytic),
    case(59, "uneven scale of instances", Reference, meshes::instances),
    case(60, "ten runs", Paths, views::ten_runs),
];

/// Case 1: rays, then pictures.
fn far_origin(lab: &mut Lab) -> Result<Checks> {
    let mut checks = meshes::far_origin(lab)?;
    views::far_city(lab, &mut checks)?;
    Ok(checks)
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_case_is_there_once() {
        assert!(super::CASES.iter().map(|case| case.number).eq(1..=60));
    }
}
