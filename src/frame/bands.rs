//! Pictures that are rendered in bands of rows, one after the other, and joined on the host.
//!
//! A band is whole tiles high and as wide as the picture: its tiles are those of the picture, its camera rays and
//! random numbers are those of the pixels. So what is joined is, bit for bit, what is rendered at once. Rows of the
//! last band that lie below the picture have no rays.

use super::FrameOutput;
use crate::counters::Record;

/// How large a band and its picture are.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// Pixels of the band that the picture has.
    pub band: usize,
    /// Pixels of the picture.
    pub picture: usize,
}

impl Joint {
    /// Adds the values of a band's pixels to those above them. What was not asked for has no values.
    fn join<T>(self, above: &mut Vec<T>, mut values: Vec<T>) {
        values.truncate(self.band);
        if above.is_empty() && values.len() == self.picture {
            *above = values;
        } else if !values.is_empty() {
            // No more than is needed: these are the largest things on the host.
            above.reserve_exact(self.picture - above.len());
            above.append(&mut values);
        }
    }
}

impl FrameOutput {
    /// Adds what a band shows below what there is, and what its passes did.
    pub fn append(&mut self, band: Self, joint: Joint) {
        let Self { pixels, coverage, guides, records } = band;
        records.into_iter().for_each(|record| self.add_record(record));
        joint.join(&mut self.pixels.radiance, pixels.radiance);
        joint.join(&mut self.pixels.depth, pixels.depth);
        joint.join(&mut self.pixels.normal, pixels.normal);
        joint.join(&mut self.pixels.id, pixels.id);
        joint.join(&mut self.pixels.albedo, pixels.albedo);
        joint.join(&mut self.coverage, coverage);
        if let Some(mut guides) = guides {
            let seen = std::mem::take(&mut guides.seen);
            let second = std::mem::take(&mut guides.second);
            let noise = std::mem::take(&mut guides.noise);
            let [direct, around] = [&mut guides.direct, &mut guides.around].map(std::mem::take);
            let all = self.guides.get_or_insert(guides);
            joint.join(&mut all.seen, seen);
            joint.join(&mut all.direct, direct);
            joint.join(&mut all.around, around);
            joint.join(&mut all.noise, noise);
            joint.join(&mut all.second, second);
        }
    }

    /// Adds what passes did to what those of the same effect did before.
    fn add_record(&mut self, record: Record) {
        match self.records.iter_mut().find(|own| own.pass == record.pass) {
            Some(own) => own.go_on(&record),
            None => self.records.push(record),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counters::Counters;
    use crate::frame::Pixels;

    #[test]
    fn rows_below_the_picture_are_left_out() {
        let band = |value: f32| {
            let pixels = Pixels { radiance: vec![[value; 3]; 4], ..Pixels::default() };
            FrameOutput { pixels, coverage: vec![value > 0.0; 4], ..FrameOutput::default() }
        };
        let mut all = FrameOutput::default();
        all.append(band(1.0), Joint { band: 4, picture: 6 });
        all.append(band(0.0), Joint { band: 2, picture: 6 });
        assert_eq!(all.pixels.radiance, [[1.0; 3], [1.0; 3], [1.0; 3], [1.0; 3], [0.0; 3], [0.0; 3]]);
        assert_eq!(all.coverage, [true, true, true, true, false, false]);
        assert!(all.pixels.depth.is_empty() && all.guides.is_none());
        assert_eq!(all.pixels.radiance.capacity(), 6);
    }

    #[test]
    fn bands_count_for_the_effects_of_their_picture() {
        let band = |passes: &[&'static str], bricks: &[u32]| {
            let record = |&pass: &&'static str| {
                let mut counters = Counters { rays_traced: 4, bricks_resident_end: 7, ..Counters::default() };
                counters.bricks_hit.extend(bricks.iter().copied());
                Record::of(3, pass, counters)
            };
            FrameOutput { records: passes.iter().map(record).collect(), ..FrameOutput::default() }
        };
        let mut all = FrameOutput::default();
        let joint = Joint { band: 1, picture: 2 };
        all.append(band(&["primary", "ao"], &[1, 2]), joint);
        all.append(band(&["primary", "shadow"], &[2, 3]), joint);
        let found: Vec<_> = all.records.iter().map(|r| (r.pass, r.rays_traced, r.bricks_hit.count())).collect();
        assert_eq!(found, [("primary", 8, 3), ("ao", 4, 2), ("shadow", 4, 2)]);
        assert_eq!(all.records[0].bricks_resident_end, 7);
    }
}
