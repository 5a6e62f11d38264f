//! Every quantity that can be scaled, in one typed structure.
//!
//! The macro `settings!` declares a group of settings once: name, type, default, range and meaning. From that come
//! the `struct` with its documentation, the TOML form and the list [`keys`], so that no front end can miss one.

use serde::{Deserialize, Serialize};

use crate::gl::DriverInfo;
use crate::{Error, Result};

/// What values a setting takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A number in a closed range.
    Float {
        /// Smallest value.
        min: f32,
        /// Largest value.
        max: f32,
    },
    /// A whole number in a closed range.
    Integer {
        /// Smallest value.
        min: u32,
        /// Largest value.
        max: u32,
    },
    /// A power of two in a closed range.
    PowerOfTwo {
        /// Smallest value.
        min: u32,
        /// Largest value.
        max: u32,
    },
    /// True or false.
    Bool,
    /// One of these names.
    Choice(&'static [&'static str]),
}

impl std::fmt::Display for Kind {
    /// The allowed values, as messages and lists print them.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Kind::Float { min, max } => write!(f, "{min} to {max}"),
            Kind::Integer { min, max } => write!(f, "whole number, {min} to {max}"),
            Kind::PowerOfTwo { min, max } => write!(f, "power of two, {min} to {max}"),
            Kind::Bool => f.write_str("true, false"),
            Kind::Choice(names) => f.write_str(&names.join(", ")),
        }
    }
}

impl Kind {
    /// The name of the type: `float`, `integer`, `bool` or `choice`.
    pub fn type_name(&self) -> &'static str {
        match self {
            Kind::Float { .. } => "float",
            Kind::Integer { .. } | Kind::PowerOfTwo { .. } => "integer",
            Kind::Bool => "bool",
            Kind::Choice(_) => "choice",
        }
    }

    fn allows(&self, value: &toml::Value) -> bool {
        let integer = |min, max| value.as_integer().filter(|i| (i64::from(min)..=i64::from(max)).contains(i));
        match *self {
            Kind::Float { min, max } => {
                let number = value.as_float().or(value.as_integer().map(|i| i as f64));
                // Compare in f32, so that a range's end may be written in decimals.
                number.is_some_and(|x| (min..=max).contains(&(x as f32)))
            }
            Kind::Integer { min, max } => integer(min, max).is_some(),
            Kind::PowerOfTwo { min, max } => integer(min, max).is_some_and(|i| i.count_ones() == 1),
            Kind::Bool => value.is_bool(),
            Kind::Choice(names) => value.as_str().is_some_and(|s| names.contains(&s)),
        }
    }
}

/// A setting as lists and panels show it.
#[derive(Clone, Debug)]
pub struct Key {
    /// Dotted name, for example `wave.delta_theta`.
    pub name: String,
    /// Type and range.
    pub kind: Kind,
    /// One line of meaning.
    pub meaning: &'static str,
}

macro_rules! choices {
    ($(#[$meta:meta])* $name:ident { $($(#[$vmeta:meta])* $variant:ident = $text:literal),+ $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum $name { $($(#[$vmeta])* #[serde(rename = $text)] $variant),+ }

        impl $name {
            const NAMES: &'static [&'static str] = &[$($text),+];

            /// The name in settings and on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text),+ }
            }
        }
    };
}

impl Tier {
    /// Whether that is compute shaders on such a driver.
    pub(crate) fn computes(self, info: &DriverInfo) -> bool {
        match self {
            Self::Auto => info.compute && !info.software,
            Self::Fragment => false,
            Self::Compute => info.compute,
        }
    }
}

impl Visibility {
    pub(crate) fn has_isms(self) -> bool {
        matches!(self, Self::Ism | Self::Mixed)
    }

    pub(crate) fn has_shadow_maps(self) -> bool {
        matches!(self, Self::ShadowMaps | Self::Mixed)
    }
}

macro_rules! settings {
    ($(#[$meta:meta])* $name:ident, $prefix:literal {
        $(#[doc = $doc:literal] $field:ident: $type:ty = $default:expr, $kind:expr;)+
    } $({ $(#[doc = $gdoc:literal] $group:ident: $gtype:ty;)+ })?) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(#[doc = $doc] pub $field: $type,)+
            $($(#[doc = $gdoc] pub $group: $gtype,)+)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)+ $($($group: Default::default(),)+)? }
            }
        }

        impl $name {
            fn collect(keys: &mut Vec<Key>) {
                $(keys.push(Key {
                    name: concat!($prefix, stringify!($field)).to_owned(),
                    kind: $kind,
                    meaning: $doc.trim_ascii(),
                });)+
                $($(<$gtype>::collect(keys);)+)?
            }
        }
    };
}

choices! {
    /// How the light that reaches a surface goes on.
    Model {
        /// The lattice of virtual point lights in stacked hemispheres.
        Wave = "wave",
        /// VPLs where light meets surfaces, for every reflection.
        Reflected = "reflected",
    }
}

choices! {
    /// What decides whether a surface sees a VPL.
    Visibility {
        /// Every surface sees every VPL.
        None = "none",
        /// Imperfect shadow maps for all VPLs (Ritschel et al. 2008).
        Ism = "ism",
        /// A stochastic sample of the VPLs, each with a regular shadow map.
        ShadowMaps = "shadow_maps",
        /// Regular shadow maps for the VPLs that matter most to the view, imperfect ones for the others.
        Mixed = "mixed",
        /// Every surface sees every VPL; the sum is dimmed by ambient occlusion.
        Ao = "ao",
        /// Directional ambient occlusion: a VPL is hidden by what stands near the surface in its direction.
        Dao = "dao",
    }
}

choices! {
    /// Which shaders make indirect light, where the driver has more than one kind.
    Tier {
        /// Compute shaders where the driver has them and draws on a GPU, else fragment shaders.
        Auto = "auto",
        /// Fragment shaders, of OpenGL 3.3 or OpenGL ES 3.0.
        Fragment = "fragment",
        /// Compute shaders of OpenGL 4.3.
        Compute = "compute",
    }
}

choices! {
    /// What the distances of the shells are measured against.
    Depth {
        /// The farthest depth in the light's shadow map: shells are true hemispheres.
        Scene = "scene",
        /// The depth along each ray: no VPL passes a surface.
        Ray = "ray",
    }
}

choices! {
    /// How the attenuation of a shell is read.
    Attenuation {
        /// The VPL keeps 1 − a.
        Absorbed = "absorbed",
        /// The VPL keeps a.
        Transmitted = "transmitted",
    }
}

choices! {
    /// How much each ray carries.
    Weighting {
        /// Every ray the same.
        Uniform = "uniform",
        /// The solid angle of the ray's cell times the light's profile.
        SolidAngle = "solid_angle",
    }
}

choices! {
    /// What colours the VPLs of a ray.
    Tint {
        /// The light's colour.
        None = "none",
        /// The light's colour times the albedo where the ray ends.
        Surface = "surface",
    }
}

choices! {
    /// What the energy rule takes the flux of the lattice to be.
    Energy {
        /// What the VPLs emit.
        Emitted = "emitted",
        /// What the bound on the distance lets arrive.
        Received = "received",
    }
}

choices! {
    /// How the VPLs are summed.
    GatherMethod {
        /// Every VPL at every pixel.
        Exact = "exact",
        /// Each of n × n neighbouring pixels sums its own subset of the VPLs, and a filter shares the sums (Segovia et al.
        /// 2006).
        Interleaved = "interleaved",
    }
}

settings! {
    /// The lattice of virtual point lights.
    Wave, "wave." {
        /// Step of the angle off the light's axis, degrees; divides 90.
        delta_theta: f32 = 5.0, Kind::Float { min: 0.5, max: 90.0 };
        /// Step of the angle around the light's axis, degrees; divides 360.
        delta_phi: f32 = 5.0, Kind::Float { min: 0.5, max: 360.0 };
        /// VPLs on every ray, one for each hemisphere.
        shells: u32 = 5, Kind::Integer { min: 1, max: 16 };
        /// Distance of the farthest shell from the light, as a share of the depth.
        reach: f32 = 0.97, Kind::Float { min: 0.05, max: 1.0 };
        /// Distance of a shell over that of the shell before it.
        ratio: f32 = 1.02, Kind::Float { min: 1.01, max: 8.0 };
        /// What the distances of the shells are shares of: the farthest depth in the shadow map, or each ray's own.
        depth: Depth = Depth::Ray, Kind::Choice(Depth::NAMES);
        /// Whether a shell's attenuation is what the VPL loses or what it keeps.
        attenuation: Attenuation = Attenuation::Transmitted, Kind::Choice(Attenuation::NAMES);
        /// Whether rays carry the same, or their solid angle times the light's profile.
        weighting: Weighting = Weighting::SolidAngle, Kind::Choice(Weighting::NAMES);
        /// Whether VPLs have the light's colour, or that times the albedo where their ray ends.
        tint: Tint = Tint::Surface, Kind::Choice(Tint::NAMES);
        /// Whether the energy rule counts what the VPLs emit, or what arrives in spite of the bound `gather.d_min`.
        energy: Energy = Energy::Received, Kind::Choice(Energy::NAMES);
        /// Stochastic fraction: the share of VPLs that is on, by a hash; the rest is made up for.
        fraction: f32 = 1.0, Kind::Float { min: 0.001, max: 1.0 };
        /// Draw the stochastic fraction anew in every frame.
        redraw: bool = false, Kind::Bool;
    }
}

settings! {
    /// Reflected waves.
    Reflected, "reflected." {
        /// Generations traced with all rays; there are at most as many VPLs as the lattice has rays, times this.
        bounces: u32 = 5, Kind::Integer { min: 1, max: 16 };
        /// Rays that each generation traces for each one that the lattice has.
        rays: u32 = 16, Kind::Integer { min: 1, max: 64 };
        /// Frames in which VPLs take up that lights or things moved, each with its part of the rays; 1: placed anew.
        frames: u32 = 8, Kind::Integer { min: 1, max: 64 };
        /// Sides of the rectangle that a VPL stands for, over those of the one that has its share of the surface.
        radius: f32 = 1.0, Kind::Float { min: 0.0, max: 16.0 };
    }
}

settings! {
    /// The primary light's shadow map, and those of the other lights.
    Shadow, "shadow." {
        /// Texels along the edge of a face of a shadow map.
        size: u32 = 1024, Kind::PowerOfTwo { min: 64, max: 8192 };
        /// Half the width of the percentage closer filter, texels.
        filter: f32 = 1.0, Kind::Float { min: 0.0, max: 8.0 };
    }
}

settings! {
    /// Imperfect shadow maps (Ritschel et al. 2008).
    Ism, "ism." {
        /// Texels along the edge of a VPL's octahedral tile.
        size: u32 = 64, Kind::PowerOfTwo { min: 8, max: 128 };
        /// Surface samples that each VPL splats into its tile.
        points: u32 = 1024, Kind::PowerOfTwo { min: 16, max: 65536 };
        /// Surface samples that stand for one of those where it is near.
        near: u32 = 4, Kind::PowerOfTwo { min: 1, max: 16 };
        /// Surface samples of the whole scene, of which every VPL draws its own subset.
        surfels: u32 = 131072, Kind::PowerOfTwo { min: 1024, max: 4194304 };
        /// Radius of a splat, in radii of the disc that has the surface sample's area.
        spread: f32 = 1.1, Kind::Float { min: 0.5, max: 4.0 };
        /// Levels of pull-push that close holes; 0 leaves them open.
        pull_levels: u32 = 2, Kind::Integer { min: 0, max: 6 };
    }
}

settings! {
    /// Regular shadow maps of VPLs.
    ShadowMaps, "shadow_maps." {
        /// VPLs that have them: a sample in proportion to their power, or with `visibility=mixed` the most important.
        count: u32 = 128, Kind::Integer { min: 1, max: 8192 };
        /// Texels along the edge of a face of a sampled VPL's depth map.
        size: u32 = 128, Kind::PowerOfTwo { min: 16, max: 1024 };
        /// Memory for the depth maps that exist at a time, MiB.
        memory: u32 = 128, Kind::Integer { min: 1, max: 8192 };
    }
}

settings! {
    /// Direct light of emissive surfaces.
    Emission, "emission." {
        /// Points of emissive surfaces that light the scene directly, each with a shadow map as `shadow_maps` has them.
        samples: u32 = 64, Kind::Integer { min: 1, max: 4096 };
    }
}

settings! {
    /// Ambient occlusion and directional ambient occlusion (Yu et al. 2009), in image space.
    Ao, "ao." {
        /// Distance up to which surfaces occlude, as a share of the depth of the scene seen by the light.
        radius: f32 = 0.25, Kind::Float { min: 0.001, max: 4.0 };
    }
}

settings! {
    /// The sum over the VPLs at every pixel.
    Gather, "gather." {
        /// How the VPLs are summed.
        method: GatherMethod = GatherMethod::Exact, Kind::Choice(GatherMethod::NAMES);
        /// n of the interleaved gather: n × n subsets of the VPLs.
        interleave: u32 = 4, Kind::PowerOfTwo { min: 2, max: 16 };
        /// VPLs that a pixel of the interleaved gather sums in a frame at most, near ones aside; of more, others in turn.
        most: u32 = 1024, Kind::Integer { min: 1, max: 65536 };
        /// The interleaved gather takes one of 2 × 2 pixels.
        half: bool = false, Kind::Bool;
        /// Frames of which the interleaved gather takes the mean while the view moves; 1: each frame for itself.
        history: u32 = 64, Kind::Integer { min: 1, max: 1024 };
        /// Distance below which a VPL gets no brighter, as a share of the depth of the scene seen by the light.
        d_min: f32 = 0.3, Kind::Float { min: 0.0001, max: 1.0 };
        /// Sum what glossy surfaces reflect of reflected waves; else the base colour stands for all they reflect.
        specular: bool = true, Kind::Bool;
    }
}

settings! {
    /// Every setting. `Settings::default()` is the preset `exact`.
    Settings, "" {
        /// How indirect light is made.
        model: Model = Model::Reflected, Kind::Choice(Model::NAMES);
        /// What decides whether a surface sees a VPL.
        visibility: Visibility = Visibility::Ism, Kind::Choice(Visibility::NAMES);
        /// Factor on the flux of the VPLs; 1 is the energy rule.
        strength: f32 = 1.0, Kind::Float { min: 0.0, max: 1000.0 };
        /// Whether compute shaders make indirect light, or fragment shaders; the picture is the same.
        tier: Tier = Tier::Auto, Kind::Choice(Tier::NAMES);
    } {
        /// The lattice.
        wave: Wave;
        /// Reflected waves.
        reflected: Reflected;
        /// Shadow maps of the lights.
        shadow: Shadow;
        /// Direct light of emissive surfaces.
        emission: Emission;
        /// Imperfect shadow maps.
        ism: Ism;
        /// Shadow maps of sampled VPLs.
        shadow_maps: ShadowMaps;
        /// Ambient occlusion.
        ao: Ao;
        /// The sum over the VPLs.
        gather: Gather;
    }
}

/// Names of the presets, in the order in which lists show them.
pub const PRESETS: [&str; 6] = ["thesis", "wave", "fast", "balanced", "quality", "exact"];

/// The quality dial: presets from the fastest to the best.
pub const DIAL: [&str; 4] = ["fast", "balanced", "quality", "exact"];

/// Every setting, in the order of the structure.
pub fn keys() -> Vec<Key> {
    let mut keys = Vec::new();
    Settings::collect(&mut keys);
    keys
}

impl Settings {
    /// A preset by name (one of [`PRESETS`]).
    pub fn preset(name: &str) -> Result<Self> {
        let mut s = Self::default();
        match name {
            "exact" => {}
            "wave" => s.model = Model::Wave,
            // Section 1 of the design to the letter.
            "thesis" => {
                s.model = Model::Wave;
                (s.wave.delta_theta, s.wave.delta_phi, s.wave.shells) = (5.0, 5.0, 5);
                (s.visibility, s.gather.method) = (Visibility::Ism, GatherMethod::Exact);
                s.wave.attenuation = Attenuation::Absorbed;
                s.wave.weighting = Weighting::Uniform;
                s.wave.tint = Tint::None;
                s.wave.depth = Depth::Scene;
                (s.wave.reach, s.wave.ratio) = (0.8, 2.0);
                s.wave.energy = Energy::Emitted;
                s.gather.d_min = 0.05;
                // Not of the description: VPLs in mid-air want their surfaces closed more than they want them sharp.
                s.ism.spread = 1.3;
            }
            "fast" => {
                s.wave.delta_theta = 10.0;
                s.wave.delta_phi = 10.0;
                s.ism.size = 32;
                s.ism.points = 512;
                (s.gather.method, s.gather.interleave, s.gather.most) = (GatherMethod::Interleaved, 8, 32);
            }
            "balanced" => {
                (s.gather.method, s.gather.interleave, s.gather.most) = (GatherMethod::Interleaved, 8, 20);
            }
            "quality" => {
                (s.gather.method, s.gather.interleave, s.gather.most) = (GatherMethod::Interleaved, 4, 512);
                s.shadow.size = 2048;
                s.ism.size = 128;
                s.ism.points = 4096;
            }
            _ => {
                return Err(Error::Argument {
                    what: "preset",
                    problem: format!("`{name}` is not known"),
                    allowed: PRESETS.join(", "),
                });
            }
        }
        Ok(s)
    }

    /// Whether the gather sums the glossy lobe: what `gather.specular` says, for reflected waves.
    pub fn sums_specular(&self) -> bool {
        self.gather.specular && self.model == Model::Reflected
    }

    /// The value of a dotted key, as TOML writes it; `None` if there is no such key.
    pub fn get(&self, key: &str) -> Option<toml::Value> {
        let table = toml::Value::try_from(self).ok()?;
        key.split('.').try_fold(table, |value, part| value.get(part).cloned()).map(tidy)
    }

    /// Sets a dotted key from text: a TOML value, or a bare word for a choice. Leaves `self` alone on an error.
    pub fn set(&mut self, key: &str, text: &str) -> Result<()> {
        let value = parsed(text).unwrap_or_else(|| toml::Value::String(text.to_owned()));
        let nested = key
            .rsplit('.')
            .fold(value, |value, part| toml::Value::Table(toml::Table::from_iter([(part.to_owned(), value)])));
        self.merge(&nested)
    }

    /// Sets whatever a TOML document names and leaves the rest. Leaves `self` alone on an error.
    pub fn merge_toml(&mut self, text: &str) -> Result<(), String> {
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| {
            let line = e.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            format!(
                "line {line}: {}; allowed: TOML with the keys of `huygens info --settings`, words in quotes",
                e.message()
            )
        })?;
        self.merge(&toml::Value::Table(table)).map_err(|e| e.to_string())
    }

    /// The whole structure as a TOML document.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("settings are plain tables of numbers and names")
    }

    /// Whether every value is one that its key allows, for structures that were filled in code.
    pub fn check(&self) -> Result<()> {
        let mut checked = self.clone();
        checked.merge(&toml::Value::try_from(self).expect("settings are plain tables of numbers and names"))
    }

    fn merge(&mut self, changes: &toml::Value) -> Result<()> {
        let keys = keys();
        let mut whole = toml::Value::try_from(&*self).expect("settings are plain tables of numbers and names");
        let mut pending = vec![(String::new(), changes)];
        while let Some((path, value)) = pending.pop() {
            if let Some(table) = value.as_table() {
                let is_group = path.is_empty() || keys.iter().any(|k| k.name.starts_with(&format!("{path}.")));
                if is_group {
                    let join = |name: &String| if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                    pending.extend(table.iter().map(|(name, value)| (join(name), value)));
                    continue;
                }
            }
            let key = keys.iter().find(|k| k.name == path).ok_or_else(|| unknown(&path, &keys))?;
            if !key.kind.allows(value) {
                let bare = value.as_str().and_then(parsed).is_some_and(|value| key.kind.allows(&value));
                let quotes = if bare { " in quotes" } else { "" };
                return Err(Error::Setting {
                    key: path,
                    problem: format!("`{}`{quotes} is not allowed", one_line(value)),
                    allowed: key.kind.to_string(),
                });
            }
            let slot = path.split('.').try_fold(&mut whole, |v, part| v.get_mut(part));
            *slot.expect("the key was just found") = match key.kind {
                Kind::Float { .. } => {
                    toml::Value::Float(value.as_float().or(value.as_integer().map(|i| i as f64)).unwrap_or(0.0))
                }
                _ => value.clone(),
            };
        }
        let merged: Self = whole.try_into().expect("every value was checked against its kind");
        crate::lattice::check_steps(&merged.wave)?;
        *self = merged;
        Ok(())
    }
}

/// A float that came from an f32 without the digits that f64 adds.
fn tidy(value: toml::Value) -> toml::Value {
    match value {
        toml::Value::Float(x) => toml::Value::Float((x as f32).to_string().parse().unwrap_or(x)),
        other => other,
    }
}

/// Text as TOML has a value; `None` if it is none.
fn parsed(text: &str) -> Option<toml::Value> {
    let mut table = format!("v = {text}").parse::<toml::Table>().ok().filter(|table| table.len() == 1)?;
    table.remove("v")
}

fn one_line(value: &toml::Value) -> String {
    let text = match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    text.replace(['\n', '\r'], " ").chars().take(60).collect()
}

fn unknown(path: &str, keys: &[Key]) -> Error {
    // A group by name, or a wrong name within a group: list that group; else everything.
    let group = path.split_once('.').map_or(path, |(group, _)| group);
    let mut names: Vec<&str> =
        keys.iter().map(|k| k.name.as_str()).filter(|n| n.starts_with(&format!("{group}."))).collect();
    if names.is_empty() {
        names = keys.iter().map(|k| k.name.as_str()).collect();
    }
    Error::Setting {
        key: one_line(&toml::Value::String(path.to_owned())),
        problem: "there is no such setting".to_owned(),
        allowed: names.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_keys_is_the_structure() {
        let mut names = Vec::new();
        let toml::Value::Table(table) = toml::Value::try_from(Settings::default()).unwrap() else { panic!() };
        for (name, value) in &table {
            match value.as_table() {
                Some(group) => names.extend(group.keys().map(|k| format!("{name}.{k}"))),
                None => names.push(name.clone()),
            }
        }
        let mut listed: Vec<String> = keys().into_iter().map(|k| k.name).collect();
        names.sort();
        listed.sort();
        assert_eq!(names, listed);
    }

    #[test]
    fn every_default_is_in_its_own_range_and_every_preset_loads() {
        for preset in PRESETS {
            let settings = Settings::preset(preset).unwrap();
            for key in keys() {
                let value = settings.get(&key.name).unwrap();
                assert!(key.kind.allows(&value), "{preset}: {} = {value}", key.name);
            }
            let mut read = Settings::default();
            read.merge_toml(&settings.to_toml()).unwrap();
            assert_eq!(read, settings);
        }
        assert!(Settings::preset("best").unwrap_err().to_string().contains("thesis, wave, fast"));
    }

    #[test]
    fn set_takes_numbers_words_and_quoted_words() {
        let mut s = Settings::default();
        s.set("wave.delta_theta", "10").unwrap();
        s.set("visibility", "none").unwrap();
        s.set("wave.depth", "\"ray\"").unwrap();
        s.set("wave.redraw", "true").unwrap();
        assert_eq!(
            (s.wave.delta_theta, s.visibility, s.wave.depth, s.wave.redraw),
            (10.0, Visibility::None, Depth::Ray, true)
        );
    }

    #[test]
    fn what_is_refused_says_what_is_allowed_and_changes_nothing() {
        let mut s = Settings::default();
        for (key, text, expected) in [
            ("wave.shells", "0", "1 to 16"),
            ("wave.shells", "2.5", "whole number"),
            ("wave.delta_theta", "7", "7.5"),
            ("wave.delta_phi", "7", "6.923077 and 7.058824"),
            ("wave.delta_theta", "nan", "0.5 to 90"),
            ("wave.delta_theta", "inf", "0.5 to 90"),
            ("ism.size", "33", "power of two"),
            ("visibility", "all", "none, ism, shadow_maps, mixed, ao, dao"),
            ("visibility", "a\nb", "none, ism, shadow_maps, mixed, ao, dao"),
            ("wave.sheels", "5", "wave.shells"),
            ("wave", "5", "wave.shells"),
            ("", "5", "wave.shells"),
            ("wave.shells.x", "5", "wave.shells"),
            ("nonsense", "5", "strength"),
        ] {
            let error = s.set(key, text).unwrap_err().to_string();
            assert!(error.contains(expected) && !error.contains('\n'), "{key}={text}: {error}");
        }
        assert_eq!(s, Settings::default());
        let error = s.merge_toml("wave.redraw = \"true\"").unwrap_err();
        assert!(error.contains("`true` in quotes is not allowed"), "{error}");
        let error = s.merge_toml("strength = 2\n[wave]\nshells = 99\n").unwrap_err();
        assert!(error.contains("wave.shells") && s == Settings::default(), "{error}");
        let error = s.merge_toml("strength = 2\nwave = = 3\n").unwrap_err();
        assert!(error.contains("line 2"), "{error}");
    }
}
