//! The lattice of virtual point lights (DESIGN 1.2, 1.3).
use crate::{Error, Result, settings::Wave};

/// Refuses steps that do not divide 90° and 360°; the message names the nearest that do.
pub fn check_steps(wave: &Wave) -> Result<()> {
    for (key, step, whole) in [("wave.delta_theta", wave.delta_theta, 90.0), ("wave.delta_phi", wave.delta_phi, 360.0)]
    {
        steps(key, step, whole)?;
    }
    Ok(())
}

/// How often `step` goes into `whole` degrees.
fn steps(key: &str, step: f32, whole: f32) -> Result<u32> {
    let count = f64::from(whole) / f64::from(step);
    let rounded = count.round().max(1.0);
    // f32 holds a step to 6e-8 of itself; a thousandth of a degree over the whole circle is far below a cell.
    if (f64::from(step) * rounded - f64::from(whole)).abs() <= 1e-3 {
        return Ok(rounded as u32);
    }
    let [below, above] = [count.ceil(), count.floor().max(1.0)].map(|n| (f64::from(whole) / n * 1e6).round() / 1e6);
    Err(Error::Setting {
        key: key.to_owned(),
        problem: format!("{step} does not divide {whole} degrees"),
        allowed: format!("the nearest that do are {below} and {above}"),
    })
}
