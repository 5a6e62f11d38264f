//! The window as a person uses it: on a display of its own (Xvfb), with keys, a pointer (xdotool)
//! and a clipboard (xclip), and looked at. `.ci/window` installs these programs and runs the tests.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    AtomEnum, ClientMessageData, ClientMessageEvent, ConnectionExt as _, CreateWindowAux, EventMask, PropMode,
    SelectionNotifyEvent, WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;

/// Small and quick: the scene takes a second.
const QUICK: [&str; 16] = [
    "--preset",
    "fast",
    "--set",
    "ism.size=16",
    "--set",
    "ism.points=64",
    "--set",
    "shadow.size=128",
    "--set",
    "wave.delta_theta=15",
    "--set",
    "wave.delta_phi=15",
    "--set",
    "reflected.bounces=1",
    "--size",
    "900x600",
];

/// Longest that anything may take to happen.
const PATIENCE: Duration = Duration::from_secs(60);

/// What the tests run beside the program.
const NEEDED: &str = "Xvfb, xdotool and xclip are needed: `apt-get install xvfb xdotool xclip`";

/// A display without a monitor.
struct Display {
    server: Child,
    name: String,
    folder: tempfile::TempDir,
}

impl Display {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        // A server that resets when its last client leaves would break off the program, which comes while xdotool asks.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect(NEEDED);
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Self { server, name: format!(":{}", number.trim()), folder }
    }

    /// The screen: width, height, and red, green and blue of each pixel, from the XWD file that the server keeps.
    fn screen(&self) -> Picture {
        let bytes = fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let number = |i: usize| u32::from_be_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap()) as usize;
        let (width, height, line, colors) = (number(4), number(5), number(12), number(19));
        assert_eq!((number(11), number(7)), (32, 0), "32 bits a pixel, the least byte first");
        let first = number(0) + 12 * colors;
        let pixel = |i: usize| {
            let at = first + i / width * line + i % width * 4;
            [bytes[at + 2], bytes[at + 1], bytes[at]]
        };
        Picture { width, rgb: (0..width * height).map(pixel).collect() }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[derive(Clone, PartialEq)]
struct Picture {
    width: usize,
    rgb: Vec<[u8; 3]>,
}

impl Picture {
    /// Part of it.
    fn crop(&self, x: usize, y: usize, width: usize, height: usize) -> Picture {
        let rows = (y..y + height).flat_map(|row| &self.rgb[row * self.width + x..][..width]);
        Picture { width, rgb: rows.copied().collect() }
    }

    /// Mean of each channel, 0…255.
    fn mean(&self) -> [f64; 3] {
        [0, 1, 2].map(|c| self.rgb.iter().map(|p| f64::from(p[c])).sum::<f64>() / self.rgb.len() as f64)
    }

    /// Mean difference of a channel, 0…255.
    fn difference(&self, other: &Picture) -> f64 {
        let pairs = self.rgb.as_flattened().iter().zip(other.rgb.as_flattened());
        pairs.map(|(&a, &b)| f64::from(a.abs_diff(b))).sum::<f64>() / (3 * self.rgb.len()) as f64
    }
}

/// The program with its window.
struct Window {
    program: Child,
    id: String,
    display: Display,
    folder: tempfile::TempDir,
}

impl Window {
    /// Opens it and waits until its title says so.
    fn open(arguments: &[&str]) -> Self {
        Self::open_with(arguments, |_, _| ())
    }

    /// As [`Window::open`]; `prepare` gets the folder that is its home, and what is going to be run.
    fn open_with(arguments: &[&str], prepare: impl Fn(&Path, &mut Command)) -> Self {
        let (display, folder) = (Display::new(), tempfile::tempdir().unwrap());
        // A file that grows too large for a limit is an error to it, no signal that ends it.
        let mut program = Command::new("/bin/sh");
        program
            .args(["-c", r#"trap "" XFSZ; exec "$0" "$@""#, env!("CARGO_BIN_EXE_huygens")])
            .arg("view")
            .args(QUICK)
            .args(arguments)
            .current_dir(folder.path())
            .env("DISPLAY", &display.name)
            .env("HOME", folder.path())
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("XDG_DATA_HOME");
        prepare(folder.path(), &mut program);
        let mut window = Self { program: program.spawn().unwrap(), id: String::new(), display, folder };
        window.take_hold();
        window
    }

    /// Waits until it is open, and gives it the keyboard and the pointer.
    fn take_hold(&mut self) {
        self.id = until("a window opens", || {
            assert!(self.program.try_wait().unwrap().is_none(), "the program has ended");
            let found = self.xdotool(&["search", "--name", "^Huygens .*VPLs$"]);
            found.lines().find(|id| **id != self.id).map(str::to_owned)
        });
        // There is no window manager that would.
        self.xdotool(&["windowfocus", "--sync", &self.id]);
        self.xdotool(&["mousemove", "300", "300"]);
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display.name).output();
        String::from_utf8(output.expect(NEEDED).stdout).unwrap()
    }

    /// Text that was copied.
    fn clipboard(&self) -> String {
        let arguments = ["-selection", "clipboard", "-out"];
        let output = Command::new("xclip").args(arguments).env("DISPLAY", &self.display.name).output();
        String::from_utf8(output.expect(NEEDED).stdout).unwrap()
    }

    fn title(&self) -> String {
        self.xdotool(&["getwindowname", &self.id]).trim().to_owned()
    }

    fn key(&self, key: &str) {
        self.xdotool(&["key", key]);
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Waits until the title has that in it.
    fn wait_for_title(&self, part: &str) {
        until(&format!("the title has `{part}`"), || self.title().contains(part).then_some(()));
    }

    /// The picture without the panel, once it changes no more.
    fn still(&self) -> Picture {
        self.settle();
        self.display.screen().crop(0, 0, 560, 560)
    }

    /// Waits until the program has nothing to do.
    fn settle(&self) {
        until("nothing is left to do", || {
            let before = self.cpu_seconds();
            sleep(Duration::from_millis(800));
            (self.cpu_seconds() - before < 0.08).then_some(())
        });
    }

    /// Time that the program has used, s.
    fn cpu_seconds(&self) -> f64 {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.program.id())).unwrap();
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
        (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
    }

    /// Drags with a button from one point to another.
    fn drag(&self, button: &str, from: (i32, i32), to: (i32, i32)) {
        let at = |x: i32, y: i32| self.xdotool(&["mousemove", &x.to_string(), &y.to_string()]);
        at(from.0, from.1);
        sleep(Duration::from_millis(300));
        self.xdotool(&["mousedown", button]);
        for step in 1..=8 {
            sleep(Duration::from_millis(60));
            at(from.0 + (to.0 - from.0) * step / 8, from.1 + (to.1 - from.1) * step / 8);
        }
        sleep(Duration::from_millis(400));
        self.xdotool(&["mouseup", button]);
        at(300, 300);
    }

    /// Drags files from another program and lets them fall on the picture: the source's part of XDND, version 5.
    fn drop_files(&self, uris: &str) {
        let (x11, screen) = x11rb::connect(Some(&self.display.name)).unwrap();
        let root = &x11.setup().roots[screen];
        let source = x11.generate_id().unwrap();
        let look = CreateWindowAux::new();
        x11.create_window(0, source, root.root, 0, 0, 1, 1, 0, WindowClass::INPUT_ONLY, 0, &look).unwrap();
        let atom = |name: &str| x11.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
        let [aware, selection, list] = ["XdndAware", "XdndSelection", "text/uri-list"].map(atom);
        let [enter, position, status, drop, finished, copy] =
            ["Enter", "Position", "Status", "Drop", "Finished", "ActionCopy"].map(|name| atom(&format!("Xdnd{name}")));

        let window: u32 = self.id.parse().unwrap();
        let reply = x11.get_property(false, window, aware, AtomEnum::ATOM, 0, 1).unwrap().reply().unwrap();
        assert_eq!(reply.value32().unwrap().next(), Some(5), "it tells that it takes what is dropped");
        x11.set_selection_owner(source, selection, x11rb::CURRENT_TIME).unwrap();
        let send = |kind: u32, data: [u32; 4]| {
            let data = ClientMessageData::from([source, data[0], data[1], data[2], data[3]]);
            let message = ClientMessageEvent { data, ..ClientMessageEvent::new(32, window, kind, [0; 5]) };
            x11.send_event(false, window, EventMask::NO_EVENT, message).unwrap();
            x11.flush().unwrap();
        };
        send(enter, [5 << 24, list, 0, 0]);
        send(position, [0, 300 << 16 | 300, x11rb::CURRENT_TIME, copy]);
        // Both answers come before the button is let go.
        let (mut accepted, mut given, mut dropped) = (false, false, false);
        until("the window takes what is dropped", || {
            while let Some(event) = x11.poll_for_event().unwrap() {
                match event {
                    Event::SelectionRequest(asked) if asked.selection == selection && asked.target == list => {
                        let (window, property) = (asked.requestor, asked.property);
                        x11.change_property8(PropMode::REPLACE, window, property, list, uris.as_bytes()).unwrap();
                        let notify = SelectionNotifyEvent {
                            response_type: x11rb::protocol::xproto::SELECTION_NOTIFY_EVENT,
                            sequence: 0,
                            time: asked.time,
                            requestor: window,
                            selection,
                            target: list,
                            property,
                        };
                        x11.send_event(false, window, EventMask::NO_EVENT, notify).unwrap();
                        x11.flush().unwrap();
                        given = true;
                    }
                    Event::ClientMessage(message) if message.type_ == status => {
                        accepted |= message.data.as_data32()[1] & 1 == 1;
                    }
                    Event::ClientMessage(message) if message.type_ == finished => return Some(()),
                    _ => {}
                }
            }
            if accepted && given && !dropped {
                send(drop, [0, x11rb::CURRENT_TIME, 0, 0]);
                dropped = true;
            }
            None
        });
    }

    /// Waits until something is said to be wrong, in red over the picture's lower left.
    fn wait_for_refusal(&self) {
        let is_red = |rgb: &[u8; 3]| *rgb == [180, 0, 0] || *rgb == [255, 120, 110];
        until("something is refused", || {
            let message = self.display.screen().crop(0, 400, 560, 200);
            (message.rgb.iter().filter(|rgb| is_red(rgb)).count() > 50).then_some(())
        });
    }

    /// The line that renders this picture, from a screenshot's settings; and the screenshot.
    fn screenshot(&self, number: u32) -> (String, PathBuf) {
        self.key("F12");
        let file = self.path(&format!("huygens-{number:04}.toml"));
        let text = until("a screenshot is written", || fs::read_to_string(&file).ok());
        let command = text.lines().next().unwrap().strip_prefix("# huygens ").unwrap().to_owned();
        (command, file.with_extension("png"))
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// Asks until there is an answer.
fn until<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(begun.elapsed() < PATIENCE, "not within {PATIENCE:?}: {what}");
        sleep(Duration::from_millis(100));
    }
}

fn read_png(path: &Path) -> Picture {
    let image = image::open(path).unwrap().into_rgb8();
    Picture { width: image.width() as usize, rgb: image.pixels().map(|p| p.0).collect() }
}

/// A glTF file with a triangle of that colour, 2 m wide and high; `more` follows.
fn triangle(color: &str, more: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "material": 0}}]}}],
        "materials": [{{"doubleSided": true, "pbrMetallicRoughness": {{"metallicFactor": 0,
            "baseColorFactor": [{color}, 1]}}}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [-1, -1, 0], "max": [1, 1, 0]}},
            {{"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]}},
            {{"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 8}},
            {{"buffer": 0, "byteOffset": 44, "byteLength": 24}}],
        "buffers": [{{"byteLength": 68, "uri": "data:application/octet-stream;base64,{}"}}]{more}}}"#,
        // Corners; times 0 and 1 s; translations by nothing and by 1 m along x.
        concat!("AACAvwAAgL8AAAAAAACAPwAAgL8AAAAAAAAAAAAAgD8AAAAA", "AAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAA=")
    )
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn keys_change_the_lattice_and_undo_changes_it_back() {
    let window = Window::open(&["--set", "model=wave", "--set", "wave.delta_theta=5", "--set", "wave.delta_phi=5"]);
    window.wait_for_title("6485 VPLs");
    for (key, vpls) in [
        // 1297 rays less each.
        ("bracketleft", "5188"),
        ("bracketleft", "3891"),
        ("ctrl+z", "6485"),
        ("ctrl+y", "3891"),
        ("bracketright", "5188"),
        // Of 18 steps of θ four fifths are left, 14: 14 · 72 + 1 rays.
        ("t", "4036"),
        ("shift+t", "5188"),
        // Of 72 steps of φ 57: 18 · 57 + 1 rays.
        ("p", "4108"),
    ] {
        window.key(key);
        window.wait_for_title(&format!(" {vpls} VPLs"));
        // What follows quickly is undone together.
        sleep(Duration::from_millis(if key == "bracketleft" && vpls == "5188" { 0 } else { 2500 }));
    }
    window.key("m");
    until("reflected waves have other VPLs", || (!window.title().contains(" 4108 VPLs")).then_some(()));
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn a_still_view_ends_and_keys_show_other_light() {
    let window = Window::open(&["builtin:column"]);
    let all = window.still();
    assert_eq!(all.mean().map(|x| x > 20.0), [true; 3], "{:?}", all.mean());
    // Nothing is done while nothing happens.
    let before = window.cpu_seconds();
    sleep(Duration::from_secs(3));
    assert!(window.cpu_seconds() - before < 0.1);
    assert!(window.display.screen().crop(0, 0, 560, 560) == all);
    window.key("l");
    let direct = window.still();
    window.key("l");
    let indirect = window.still();
    window.key("l");
    let again = window.still();
    assert!(all.difference(&direct) > 5.0 && all.difference(&indirect) > 2.0 && direct.difference(&indirect) > 5.0);
    // Means over frames begin anew, of other subsets of the VPLs.
    assert!(again.difference(&all) < 2.0, "{}", again.difference(&all));
    // The light goes out: what is left is black.
    window.key("o");
    let dark = window.still();
    assert!(dark.crop(0, 0, 560, 500).mean().iter().all(|&x| x < 1.0), "{:?}", dark.mean());
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn the_pointer_moves_the_camera_and_a_command_line_makes_the_same_picture() {
    let window = Window::open(&["builtin:column", "--exposure", "2"]);
    let first = window.still();
    window.drag("1", (250, 250), (330, 230));
    let turned = window.still();
    assert!(turned.difference(&first) > 5.0, "{}", turned.difference(&first));
    window.drag("2", (250, 250), (280, 280));
    let moved = window.still();
    assert!(moved.difference(&turned) > 5.0);
    window.drag("3", (250, 250), (230, 250));
    assert!(window.still().difference(&moved) > 2.0);
    window.xdotool(&["click", "4"]);
    let near = window.still();
    window.xdotool(&["keydown", "s"]);
    sleep(Duration::from_millis(700));
    window.xdotool(&["keyup", "s"]);
    assert!(window.still().difference(&near) > 1.0);
    window.xdotool(&["keydown", "Right"]);
    sleep(Duration::from_millis(700));
    window.xdotool(&["keyup", "Right"]);
    window.still();

    let (command, png) = window.screenshot(1);
    assert!(
        command.contains(" --eye ") && command.contains(" --light ") && command.contains(" --exposure 2"),
        "{command}"
    );
    window.key("ctrl+shift+c");
    let copied = until("the line is on the clipboard", || Some(window.clipboard()).filter(|text| !text.is_empty()));
    assert_eq!(copied.replace("huygens.png", "huygens-0001.png"), format!("huygens {command}"));
    let arguments: Vec<&str> = command.split_whitespace().collect();
    let made = window.path("again.png");
    let output = Command::new(env!("CARGO_BIN_EXE_huygens"))
        .args(arguments.iter().map(|part| if part.ends_with(".png") { made.to_str().unwrap() } else { part }))
        .current_dir(window.folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    let (shown, rendered) = (read_png(&png), read_png(&made));
    // VPLs of the window followed the light, those of the program are laid anew.
    assert!(shown.width == rendered.width && shown.difference(&rendered) < 2.0, "{}", shown.difference(&rendered));

    // What is told of the screenshot lies over the picture for a while.
    sleep(Duration::from_secs(7));
    window.key("r");
    let back = window.still().difference(&first);
    assert!(back < 2.0, "{back}");
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn handles_move_the_light_and_undo_moves_it_back() {
    // The light is in the middle of the picture, which is as wide as it is high.
    let view = ["--light", "0,1,0", "--eye", "0,1,2", "--target", "0,1,0", "--exposure", "2"];
    let window = Window::open(&[&["builtin:column"], &view[..]].concat());
    let first = window.still();
    window.key("g");
    window.drag("1", (300, 300), (360, 300));
    window.key("g");
    let moved = window.still();
    assert!(moved.difference(&first) > 2.0, "{}", moved.difference(&first));
    let (command, _) = window.screenshot(1);
    let place = command.split(" --light ").nth(1).unwrap().split(' ').next().unwrap();
    let place: Vec<f32> = place.split(',').map(|x| x.parse().unwrap()).collect();
    assert!(place[0] > 0.1 && (place[1] - 1.0).abs() < 0.02 && place[2].abs() < 0.02, "{place:?}");
    window.key("ctrl+z");
    sleep(Duration::from_secs(7));
    let back = window.still().difference(&first);
    assert!(back < 2.0, "{back}");
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn a_file_that_changes_is_read_again_and_a_broken_one_leaves_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.gltf");
    let scene = |color: &str| triangle(color, "");
    fs::write(&path, scene("1, 0, 0")).unwrap();
    let window = Window::open(&[path.to_str().unwrap()]);
    let is = |name: &str, channel: usize| {
        until(&format!("the picture is {name}"), || {
            let mean = window.display.screen().crop(0, 0, 560, 540).mean();
            (0..3).all(|c| c == channel || mean[channel] > 2.0 * mean[c] + 1.0).then_some(())
        });
    };
    is("red", 0);
    window.settle();
    // As programs do that replace a file.
    fs::write(folder.path().join("new.gltf"), scene("0, 1, 0")).unwrap();
    fs::rename(folder.path().join("new.gltf"), &path).unwrap();
    is("green", 1);
    window.settle();
    fs::write(&path, "{").unwrap();
    sleep(Duration::from_secs(2));
    window.settle();
    is("green", 1);
    fs::write(&path, scene("0, 0, 1")).unwrap();
    is("blue", 2);
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn any_key_in_any_order_and_any_size_leave_it_running() {
    let mut window = Window::open(&[]);
    let keys = [
        "F1",
        "question",
        "m",
        "v",
        "v",
        "v",
        "v",
        "v",
        "v",
        "b",
        "b",
        "b",
        "b",
        "b",
        "b",
        "b",
        "b",
        "b",
        "l",
        "Page_Up",
        "Page_Down",
        "Page_Down",
        "Page_Down",
        "t",
        "t",
        "t",
        "t",
        "t",
        "t",
        "t",
        "t",
        "t",
        "shift+t",
        "p",
        "p",
        "p",
        "bracketleft",
        "bracketleft",
        "bracketleft",
        "bracketleft",
        "bracketleft",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "comma",
        "period",
        "z",
        "k",
        "o",
        "space",
        "f",
        "c",
        "r",
        "ctrl+z",
        "ctrl+z",
        "ctrl+shift+z",
        "shift+F12",
        "shift+F12",
        "ctrl+shift+c",
        "h",
        "h",
        "F11",
        "F11",
        "Escape",
    ];
    for (i, key) in keys.iter().enumerate() {
        window.key(key);
        if i % 8 == 0 {
            sleep(Duration::from_millis(400));
        }
    }
    for size in ["1", "300", "1200", "700"] {
        window.xdotool(&["windowsize", &window.id, size, size]);
        sleep(Duration::from_millis(500));
    }
    window.xdotool(&["windowunmap", "--sync", &window.id]);
    sleep(Duration::from_millis(500));
    window.xdotool(&["windowmap", "--sync", &window.id]);
    window.xdotool(&["windowfocus", "--sync", &window.id]);
    window.title();
    assert!(window.program.try_wait().unwrap().is_none(), "it ended");
    window.key("ctrl+q");
    let status = until("it ends", || window.program.try_wait().unwrap());
    assert!(status.success(), "{status}");
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn a_lost_context_is_replaced_and_the_scene_comes_back() {
    let preload = |home: &Path, program: &mut Command| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/lose_context.c");
        let library = home.join("lose_context.so");
        let built = Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).status().unwrap();
        assert!(built.success());
        program.env("LD_PRELOAD", library).env("LOSE_CONTEXT", home.join("lose"));
    };
    let mut window = Window::open_with(&["builtin:column", "--exposure", "2"], preload);
    window.drag("1", (250, 250), (330, 230));
    window.key("l");
    let before = window.still();
    // A context that is lost at once is not replaced.
    sleep(Duration::from_secs(5));
    fs::write(window.path("lose"), "").unwrap();
    window.key("h");
    window.take_hold();
    assert!(!window.path("lose").exists());
    let after = window.still();
    assert!(after.difference(&before) < 2.0, "{}", after.difference(&before));
    // It works as the first one did.
    window.key("l");
    assert!(window.still().difference(&after) > 2.0);
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn animations_play_and_are_recorded() {
    let animation = r#", "animations": [{"samplers": [{"input": 1, "output": 2}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]"#;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moves.gltf");
    fs::write(&path, triangle("1, 1, 1", animation)).unwrap();
    let window = Window::open(&[path.to_str().unwrap()]);
    let rest = window.still();
    window.key("shift+F12");
    window.key("space");
    let (first, last) =
        (window.path("huygens-recording-0001/frame-00000.png"), "huygens-recording-0001/frame-00012.png");
    until("frames are recorded", || window.path(last).exists().then_some(()));
    window.key("space");
    window.key("shift+F12");
    assert!(window.still().difference(&rest) > 5.0);
    // A frame is a thirtieth of a second: after twelve the triangle stands 0.4 m farther, in the first at most one on.
    let center = |path: &Path| {
        let picture = read_png(path);
        let lit = picture.rgb.iter().enumerate().filter(|(_, rgb)| rgb[0] > 40).map(|(i, _)| i % picture.width);
        let lit: Vec<f64> = lit.map(|x| x as f64 / picture.width as f64).collect();
        lit.iter().sum::<f64>() / lit.len() as f64
    };
    let moved = center(&window.path(last)) - center(&first);
    assert!(moved > 0.03 && moved < 0.5, "{moved}");
    let count = fs::read_dir(window.path("huygens-recording-0001")).unwrap().count();
    let (command, _) = window.screenshot(1);
    let time: f64 = command.split(" --time ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    // Some frames are drawn before it plays and after.
    assert!(time > 12.0 / 30.0 - 0.07 && time < (count as f64 + 1.0) / 30.0, "{time} after {count}");
    window.key("r");
    assert!(window.still().difference(&rest) < 2.0);
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn debug_views_and_a_wipe_are_shown_in_place_of_the_picture() {
    let window = Window::open(&["builtin:column", "--exposure", "2"]);
    let picture = window.still();
    // Albedo, normal, depth and ambient occlusion come first.
    for _ in 0..4 {
        window.key("b");
    }
    let ao = window.still();
    window.key("b");
    let map = window.still();
    // The shadow map is grey, and so is what is around it.
    let is_gray = |p: &[u8; 3]| p[0].abs_diff(p[1]) < 2 && p[1].abs_diff(p[2]) < 2;
    assert!(map.rgb.iter().all(is_gray) && !picture.rgb.iter().all(is_gray) && map.difference(&ao) > 5.0);
    window.key("F12");
    sleep(Duration::from_secs(1));
    assert!(!window.path("huygens-0001.toml").exists(), "the map is no picture to render again");
    for _ in 0..4 {
        window.key("b");
    }
    // It says why there is no screenshot until that is closed.
    let again = window.still();
    assert!(again.crop(0, 0, 560, 400).difference(&picture.crop(0, 0, 560, 400)) < 2.0);
    // The path tracer, whose picture is about as bright, on the right.
    window.key("x");
    let traced = until("paths are traced", || {
        let now = window.display.screen().crop(300, 40, 260, 360);
        let (is, was) = (now.mean(), again.crop(300, 40, 260, 360).mean());
        let similar = (0..3).all(|c| is[c] > 0.8 * was[c] && is[c] < 1.25 * was[c]);
        (similar && now.difference(&again.crop(300, 40, 260, 360)) > 0.5).then_some(now)
    });
    sleep(Duration::from_secs(2));
    assert!(window.display.screen().crop(300, 40, 260, 360).difference(&traced) > 0.1, "it goes on");
    let left = window.display.screen().crop(0, 40, 250, 360);
    assert!(left.difference(&again.crop(0, 40, 250, 360)) < 2.0);
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn objects_and_vpls_are_chosen_with_a_click() {
    // The column is in the middle.
    let view = ["--eye", "0,1.2,2", "--target", "0,1.2,0", "--exposure", "2"];
    let window = Window::open(&[&["builtin:column"], &view[..]].concat());
    let first = window.still();
    let click = || {
        window.xdotool(&["mousemove", "300", "300"]);
        sleep(Duration::from_millis(300));
        window.xdotool(&["click", "1"]);
    };
    click();
    window.key("f");
    let chosen = window.still();
    assert!(chosen.difference(&first) > 2.0, "it is framed");
    window.drag("1", (300, 300), (340, 300));
    assert!(window.still().difference(&chosen) > 1.0);
    let (command, _) = window.screenshot(1);
    assert!(command.contains(" --move "), "{command}");
    window.key("r");
    sleep(Duration::from_secs(7));
    // The lattice of all VPLs lies over the picture, and nothing else does.
    let before = window.still();
    window.key("k");
    let shown = window.still();
    assert!(shown.difference(&before) > 0.3, "{}", shown.difference(&before));
    window.key("k");
    assert!(window.still() == before);
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn files_dropped_on_the_window_are_opened_and_a_broken_one_leaves_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let uri = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).unwrap();
        format!("file://{}/{}\r\n", folder.path().display(), name.replace(' ', "%20").replace('ü', "%C3%BC"))
    };
    let window = Window::open(&["builtin:column"]);
    window.still();
    window.drop_files(&uri("a grün triangle.gltf", &triangle("0, 1, 0", "")));
    window.wait_for_title("a grün triangle.gltf");
    let green = window.still();
    let mean = green.crop(0, 0, 560, 400).mean();
    assert!(mean[1] > 2.0 * mean[0] + 1.0 && mean[1] > 2.0 * mean[2] + 1.0, "{mean:?}");
    window.drop_files(&uri("broken.gltf", "{"));
    window.wait_for_refusal();
    assert!(window.title().contains("a grün triangle.gltf"), "{}", window.title());
    assert!(window.still().crop(0, 0, 560, 400).difference(&green.crop(0, 0, 560, 400)) < 2.0);
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn it_says_where_the_system_has_no_dialog() {
    let bare = |home: &Path, program: &mut Command| {
        // Neither a portal nor zenity.
        program.env("PATH", home).env("DBUS_SESSION_BUS_ADDRESS", "unix:path=/nonexistent");
    };
    let window = Window::open_with(&["builtin:column"], bare);
    window.still();
    window.key("ctrl+o");
    window.wait_for_refusal();
}

#[test]
#[ignore = "needs Xvfb, xdotool and xclip: run .ci/window"]
fn a_full_disk_ends_a_recording_and_leaves_no_folder() {
    let window = Window::open(&["builtin:column"]);
    window.still();
    // No file may grow beyond so many bytes.
    let limit = |bytes: &str| {
        let pid = window.program.id().to_string();
        let done = Command::new("prlimit").args(["--pid", &pid, &format!("--fsize={bytes}:unlimited")]).status();
        assert!(done.unwrap().success());
    };
    limit("0");
    window.key("shift+F12");
    // Something to record.
    window.key("l");
    window.wait_for_refusal();
    window.settle();
    assert!(!window.path("huygens-recording-0001").exists());
    limit("unlimited");
    window.key("shift+F12");
    window.key("l");
    until("there is room again", || window.path("huygens-recording-0001/frame-00000.png").exists().then_some(()));
}
