//! The rates of one thread over the sizes of the cities, a picture for each set of rays.

use super::SETS;
use super::table::Row;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

/// Of a picture and of all, pixels.
const SIZE: (u32, u32) = (400, 380);
/// The colours of the columns; they stay apart for colour-blind readers.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0x1f, 0x6f, 0xd0),
    RGBColor(0xe0, 0x70, 0x10),
    RGBColor(0x56, 0x60, 0x6c),
    RGBColor(0x12, 0x96, 0x72),
    RGBColor(0x9a, 0x47, 0xb8),
    RGBColor(0xc8, 0x28, 0x4e),
];

/// Writes an SVG.
pub fn draw(to: &Path, rows: &[Row]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::new(to, (SIZE.0 * SETS.len() as u32, SIZE.1)).into_drawing_area();
    root.fill(&WHITE)?;
    for (set, area) in root.split_evenly((1, SETS.len())).into_iter().enumerate() {
        let mut rows: Vec<&Row> = rows.iter().filter(|row| row.set == set).collect();
        rows.sort_by_key(|row| row.triangles);
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else { continue };
        let rate = |row: &Row, column: usize| row.rate(row.columns[column].best(|mode| &mode.processor));
        let columns = 0..first.columns.len();
        let most = rows.iter().flat_map(|row| columns.clone().map(move |k| rate(row, k))).fold(0.0, f64::max);
        let sizes = f64::from(first.triangles) * 0.8..f64::from(last.triangles) * 1.25;
        let mut chart = ChartBuilder::on(&area)
            .caption(SETS[set], ("sans-serif", 18))
            .margin(8)
            .x_label_area_size(40)
            .y_label_area_size(44)
            .build_cartesian_2d(sizes.log_scale(), 0.0..most * 1.35)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_desc("triangles")
            .y_desc("million rays a second, one thread")
            .x_label_formatter(&|triangles| match triangles {
                t if *t >= 1e6 => format!("{}M", t / 1e6),
                t => format!("{}K", t / 1e3),
            })
            .draw()?;
        for column in columns {
            let colour = COLOURS[column % COLOURS.len()];
            let points: Vec<(f64, f64)> =
                rows.iter().map(|row| (f64::from(row.triangles), rate(row, column))).collect();
            let style = ShapeStyle { color: colour.to_rgba(), filled: true, stroke_width: 2 };
            let series = chart.draw_series(LineSeries::new(points, style).point_size(3))?;
            series.label(&first.columns[column].title).legend(move |(x, y)| Circle::new((x + 8, y), 4, style));
        }
        let mut labels = chart.configure_series_labels();
        labels.position(SeriesLabelPosition::UpperRight).border_style(TRANSPARENT).draw()?;
    }
    root.present()?;
    Ok(())
}
