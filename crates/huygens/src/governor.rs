//! Holds a frame time: moves how many VPLs a pixel sums in a frame.

use crate::limits::vpl_count;
use crate::settings::{GatherMethod, Settings};

/// Frames whose median counts.
const FRAMES: usize = 5;

/// The finest step: n = 2, four subsets.
const FINEST: u32 = 2;

/// Share of the time for a frame that a finer step may be expected to take.
const FINER: f64 = 0.9;

/// Chooses settings of the interleaved gather for each frame of an animation, so that it takes no longer than it may.
///
/// Between two steps lies a factor of two in the VPLs that a pixel sums in a frame. All steps have the same mean, and
/// [`Renderer::draw`](crate::Renderer::draw) goes on with the means over frames when nothing else changes: a step shows
/// as more or less noise, not as another light. A step is taken back where the median of five frames is longer than
/// allowed, and forth where the next one is expected to leave a tenth of the time.
#[derive(Clone, Debug)]
pub struct Governor {
    settings: Settings,
    target_ms: f64,
    vpls: u32,
    /// Binary logarithm of the number of subsets of the VPLs.
    step: u32,
    /// Times of the last frames at this step and of the gather in them.
    times: Vec<[f64; 2]>,
}

impl Governor {
    /// For so many frames a second; begins with the step that is nearest to what the settings say.
    pub fn new(target_fps: f64, settings: &Settings) -> Self {
        let vpls = vpl_count(settings).max(1);
        let gather = &settings.gather;
        let places = match gather.method {
            GatherMethod::Exact => 1,
            GatherMethod::Interleaved => gather.interleave * gather.interleave,
        };
        let subsets = places.saturating_mul(vpls.div_ceil(places.saturating_mul(gather.most)));
        let mut governor = Self {
            settings: settings.clone(),
            target_ms: 1e3 / target_fps,
            vpls,
            step: subsets.ilog2(),
            times: Vec::with_capacity(FRAMES),
        };
        governor.go_to(subsets.ilog2());
        governor
    }

    /// The same from the coarsest step on, so that even the first frame is a short one.
    pub fn from_the_coarsest(mut self) -> Self {
        self.go_to(u32::MAX);
        self
    }

    /// What the next frame is to be drawn with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// VPLs that a pixel sums in a frame.
    pub fn vpls_per_pixel(&self) -> u32 {
        self.settings.gather.most
    }

    /// Takes note of how long the frame took that was drawn with [`Self::settings`], and of that the passes `gather` and
    /// `share`, ms. Whether the settings are others now.
    pub fn frame(&mut self, frame_ms: f64, gather_ms: f64) -> bool {
        self.times.push([frame_ms, gather_ms.clamp(0.0, frame_ms)]);
        if self.times.len() < FRAMES {
            return false;
        }
        let [frame, gather] = [0, 1].map(|i| {
            let mut values: Vec<f64> = self.times.iter().map(|times| times[i]).collect();
            values.sort_by(f64::total_cmp);
            values[FRAMES / 2]
        });
        self.times.remove(0);
        // The gather does not grow by more than its VPLs, nor shrink by more.
        let expected = |steps: i32| frame + gather * (f64::from(steps).exp2() - 1.0);
        if frame > self.target_ms {
            let coarser = (1..4).find(|&steps| expected(-steps) <= FINER * self.target_ms).unwrap_or(4);
            self.go_to(self.step + coarser as u32)
        } else if expected(1) <= FINER * self.target_ms {
            self.go_to(self.step.saturating_sub(1))
        } else {
            false
        }
    }

    fn go_to(&mut self, step: u32) -> bool {
        // Two VPLs at least, else some pixels have one and some none.
        let step = step.min((self.vpls / 2).max(1).ilog2()).max(FINEST);
        let interleave = (1 << (step / 2)).min(16);
        let most = self.vpls.div_ceil(1 << step);
        let changes = step != self.step;
        self.step = step;
        if changes {
            self.times.clear();
        }
        let gather = &mut self.settings.gather;
        (gather.method, gather.interleave, gather.most) = (GatherMethod::Interleaved, interleave, most);
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame costs so much beside the gather, and the gather so much for each VPL and anyhow, with some noise.
    fn cost(governor: &Governor, [beside, anyhow, per_vpl]: [f64; 3], number: u32) -> [f64; 2] {
        let noise = 1.0 + 0.04 * (f64::from(crate::sampling::random(7, 0, number)) - 0.5);
        let gather = (anyhow + per_vpl * f64::from(governor.vpls_per_pixel())) * noise;
        [beside * noise + gather, gather]
    }

    fn run(governor: &mut Governor, costs: [f64; 3], frames: u32) -> (u32, f64) {
        let (mut changes, mut last) = (0, 0.0);
        for number in 0..frames {
            let [frame, gather] = cost(governor, costs, number);
            changes += u32::from(governor.frame(frame, gather));
            last = frame;
        }
        (changes, last)
    }

    #[test]
    fn a_frame_time_is_held_without_going_to_and_fro() {
        for preset in ["fast", "balanced", "quality", "exact"] {
            let mut governor = Governor::new(20.0, &Settings::preset(preset).unwrap());
            for costs in [[10.0, 4.0, 0.2], [30.0, 8.0, 0.2], [10.0, 4.0, 0.05], [40.0, 1.0, 1.0]] {
                run(&mut governor, costs, 100);
                let (changes, last) = run(&mut governor, costs, 300);
                assert!(changes == 0 && last <= 1.03 * 50.0, "{preset} {costs:?}: {changes} {last}");
                // One step finer would be too slow, or there is none.
                let [beside, anyhow, per_vpl] = costs;
                let finer = beside + 2.0 * (anyhow + per_vpl * f64::from(governor.vpls_per_pixel()));
                assert!(finer > 0.87 * 50.0 || governor.step == FINEST, "{preset} {costs:?}: {finer}");
            }
        }
    }

    #[test]
    fn it_reacts_within_a_few_frames() {
        let mut governor = Governor::new(20.0, &Settings::preset("balanced").unwrap());
        run(&mut governor, [10.0, 2.0, 0.05], 100);
        let before = governor.vpls_per_pixel();
        run(&mut governor, [10.0, 2.0, 0.4], 10);
        assert!(cost(&governor, [10.0, 2.0, 0.4], 0)[0] < 51.0 && governor.vpls_per_pixel() < before);
    }

    #[test]
    fn it_stays_within_what_is_allowed() {
        for (preset, theta) in [("exact", 90.0), ("fast", 30.0), ("balanced", 5.0)] {
            let mut settings = Settings::preset(preset).unwrap();
            (settings.wave.delta_theta, settings.wave.delta_phi) = (theta, theta);
            for beside in [0.0, 1e9] {
                let mut governor = Governor::new(60.0, &settings);
                run(&mut governor, [beside, 0.0, 0.0], 200);
                let mut set = settings.clone();
                let gather = &governor.settings().gather;
                assert!(set.set("gather.interleave", &gather.interleave.to_string()).is_ok());
                assert!(set.set("gather.most", &gather.most.to_string()).is_ok());
                assert!(beside == 0.0 || gather.most <= 4, "{preset}: {}", gather.most);
                assert!(beside > 0.0 || gather.interleave == 2, "{preset}: {}", gather.interleave);
            }
        }
    }
}
