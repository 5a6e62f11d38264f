//! Which key does what: one list, from which come the handling of keys and the help.

use eframe::egui::{Key, KeyboardShortcut, Modifiers};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Help,
    Model,
    Visibility,
    Lights,
    View,
    Wipe,
    BetterQuality,
    WorseQuality,
    CoarserTheta,
    FinerTheta,
    CoarserPhi,
    FinerPhi,
    FewerShells,
    MoreShells,
    SmallerFraction,
    LargerFraction,
    Freeze,
    LightOnOff,
    Handles,
    Lattice,
    Play,
    FrameAll,
    NextCamera,
    Reset,
    Undo,
    Redo,
    Open,
    SaveSettings,
    CopyCommand,
    Screenshot,
    Record,
    Panel,
    FullScreen,
    Quit,
}

/// What a key asks for that was pressed.
pub fn action_of(key: Key, modifiers: Modifiers) -> Option<Action> {
    let is_it =
        |binding: &KeyboardShortcut| key == binding.logical_key && modifiers.matches_logically(binding.modifiers);
    BINDINGS.iter().find(|binding| binding.keys.iter().any(is_it)).map(|binding| binding.action)
}

/// Keys of one action.
pub struct Binding {
    /// Any of them.
    pub keys: &'static [KeyboardShortcut],
    /// What they do.
    pub action: Action,
    /// As the help says it.
    pub meaning: &'static str,
}

impl Binding {
    /// Its keys as people write them.
    pub fn keys_text(&self) -> String {
        // Those that differ only in what the keyboard makes of Shift are one key to people.
        let shown = self.keys.iter().filter(|key| key.modifiers != Modifiers::SHIFT || self.keys.len() == 1);
        let text = |key: &KeyboardShortcut| {
            let mut text = String::new();
            for (on, name) in [(key.modifiers.command, "Ctrl+"), (key.modifiers.shift, "Shift+")] {
                text.push_str(if on { name } else { "" });
            }
            text + key.logical_key.symbol_or_name()
        };
        shown.map(text).collect::<Vec<_>>().join(", ")
    }
}

const fn plain(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

const fn shift(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::SHIFT, key)
}

const fn ctrl(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

const fn ctrl_shift(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), key)
}

macro_rules! bindings {
    ($($action:ident: [$($key:expr),+] $meaning:literal;)+) => {
        &[$(Binding { keys: &[$($key),+], action: Action::$action, meaning: $meaning }),+]
    };
}

/// All of them, in the order of the help. Where one has more modifiers than another with the same key it comes first.
pub const BINDINGS: &[Binding] = bindings! {
    Help: [plain(Key::F1), plain(Key::Questionmark), shift(Key::Questionmark), shift(Key::Slash)] "this help";
    Model: [plain(Key::M)] "next model: reflected, wave";
    Visibility: [plain(Key::V)] "next visibility of VPLs";
    Lights: [plain(Key::L)] "direct and indirect light, direct alone, indirect alone";
    View: [plain(Key::B)] "next debug view";
    Wipe: [plain(Key::X)] "wipe between two pictures, off";
    BetterQuality: [plain(Key::PageUp)] "better quality: fast, balanced, quality, exact";
    WorseQuality: [plain(Key::PageDown)] "faster";
    FinerTheta: [shift(Key::T)] "finer steps of the angle off the light's axis, Δθ";
    CoarserTheta: [plain(Key::T)] "coarser steps Δθ";
    FinerPhi: [shift(Key::P)] "finer steps of the angle around the axis, Δφ";
    CoarserPhi: [plain(Key::P)] "coarser steps Δφ";
    FewerShells: [plain(Key::OpenBracket)] "one shell less";
    MoreShells: [plain(Key::CloseBracket)] "one shell more";
    SmallerFraction: [plain(Key::Comma)] "half of the stochastic fraction";
    LargerFraction: [plain(Key::Period)] "twice the stochastic fraction";
    Freeze: [plain(Key::Z)] "freeze the VPLs, whatever moves";
    LightOnOff: [plain(Key::O)] "primary light on, off";
    Handles: [plain(Key::G)] "gizmo on the primary light, off";
    Lattice: [plain(Key::K)] "show the VPLs";
    Play: [plain(Key::Space)] "play, pause animations";
    FrameAll: [plain(Key::F), plain(Key::Home)] "show the whole scene, or what is chosen";
    NextCamera: [plain(Key::C)] "next camera of the scene";
    Reset: [plain(Key::R)] "camera, lights and objects as the scene has them";
    Redo: [ctrl_shift(Key::Z), ctrl(Key::Y)] "do it again";
    Undo: [ctrl(Key::Z)] "undo";
    Open: [ctrl(Key::O)] "open a glTF file";
    SaveSettings: [ctrl(Key::S)] "save the settings as TOML";
    CopyCommand: [ctrl_shift(Key::C)] "copy the command line that renders this picture";
    Record: [shift(Key::F12)] "record numbered pictures, or end that";
    Screenshot: [plain(Key::F12)] "picture as PNG and EXR, with the settings";
    Panel: [plain(Key::H)] "panel on, off";
    FullScreen: [plain(Key::F11)] "full screen";
    Quit: [ctrl(Key::Q)] "quit";
};

/// What moves the camera and the light; it is held down, not pressed.
pub const HELD: &[(&str, &str)] = &[
    ("left button", "orbit; a click chooses an object or a VPL"),
    ("right button", "look round"),
    ("middle button, Shift + left", "pan"),
    ("wheel", "nearer, farther; with the right button: speed of flight"),
    ("W A S D, E Q", "fly; up, down"),
    ("arrows, Shift + up and down", "move the primary light across and along the view"),
    ("Ctrl + arrows", "turn the primary light"),
    ("Tab, Esc", "keys go to the panel, to the picture again"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_does_two_things_and_none_that_flies_does_another() {
        let all: Vec<&KeyboardShortcut> = BINDINGS.iter().flat_map(|b| b.keys).collect();
        for (i, key) in all.iter().enumerate() {
            assert!(!all[..i].contains(key), "{key:?}");
            let flies = [Key::W, Key::A, Key::S, Key::D, Key::Q, Key::E].contains(&key.logical_key);
            assert!(!flies || key.modifiers.command, "{key:?}");
        }
    }

    #[test]
    fn every_key_does_what_the_help_says() {
        for binding in BINDINGS {
            for key in binding.keys {
                assert_eq!(action_of(key.logical_key, key.modifiers), Some(binding.action), "{key:?}");
            }
        }
        // Where a layout needs Shift for a bracket.
        assert_eq!(action_of(Key::OpenBracket, Modifiers::SHIFT), Some(Action::FewerShells));
        assert_eq!(action_of(Key::W, Modifiers::NONE), None);
    }
}
