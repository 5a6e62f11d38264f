//! The settings as widgets, generated from the list of keys, so that none is missing.

use eframe::egui::{self, Ui};
use huygens::Settings;
use huygens::settings::{Key, Kind};

/// All groups of settings, each of which folds. What is refused is told in one line. `base` is what a reset goes back to.
pub fn groups(ui: &mut Ui, keys: &[Key], settings: &mut Settings, base: &Settings) -> Option<String> {
    let mut refused = None;
    let mut group = |ui: &mut Ui, prefix: &str, keys: &[&Key]| {
        egui::Grid::new(("settings", prefix)).num_columns(3).min_col_width(24.0).show(ui, |ui| {
            for key in keys {
                refused = row(ui, key, prefix, settings, base).or(refused.take());
                ui.end_row();
            }
        });
    };
    let alone: Vec<&Key> = keys.iter().filter(|key| !key.name.contains('.')).collect();
    group(ui, "", &alone);
    let mut groups: Vec<&str> =
        keys.iter().filter_map(|key| key.name.split_once('.')).map(|(group, _)| group).collect();
    groups.dedup();
    for name in groups {
        let prefix = format!("{name}.");
        let keys: Vec<&Key> = keys.iter().filter(|key| key.name.starts_with(&prefix)).collect();
        egui::CollapsingHeader::new(name).id_salt(("group", name)).show(ui, |ui| group(ui, &prefix, &keys));
    }
    refused
}

/// One setting: name, value and, where it differs, a reset.
fn row(ui: &mut Ui, key: &Key, prefix: &str, settings: &mut Settings, base: &Settings) -> Option<String> {
    let tip = format!("{}\n{}: {}\n--set {}=…", key.meaning, key.kind.type_name(), key.kind, key.name);
    let name = key.name.strip_prefix(prefix).unwrap_or(&key.name);
    let label = ui.label(name).on_hover_text(&tip);
    let (value, default) = (settings.get(&key.name)?, base.get(&key.name)?);
    let mut chosen = None;
    let widget = match key.kind {
        Kind::Bool => {
            let mut on = value.as_bool()?;
            let response = ui.checkbox(&mut on, "");
            chosen = response.changed().then(|| on.to_string());
            response
        }
        Kind::Float { min, max } => {
            let mut x = value.as_float()? as f32;
            let speed = (x.abs() * 0.01).max((max - min).min(1.0) * 0.001);
            let drag = egui::DragValue::new(&mut x).range(min..=max).speed(speed).max_decimals(4);
            let response = ui.add(drag.update_while_editing(false));
            chosen = response.changed().then(|| format!("{x:?}"));
            response
        }
        Kind::Integer { min, max } => {
            let mut x = value.as_integer()?;
            let speed = (x as f64 * 0.01).max(0.05);
            let drag = egui::DragValue::new(&mut x).range(i64::from(min)..=i64::from(max)).speed(speed);
            let response = ui.add(drag.update_while_editing(false));
            chosen = response.changed().then(|| x.to_string());
            response
        }
        Kind::PowerOfTwo { min, max } => {
            let powers = (min.ilog2()..=max.ilog2()).map(|power| (1_u32 << power).to_string());
            choice(ui, &key.name, &value.to_string(), powers, &mut chosen)
        }
        Kind::Choice(names) => {
            choice(ui, &key.name, value.as_str()?, names.iter().map(|&name| name.to_owned()), &mut chosen)
        }
    };
    widget.labelled_by(label.id).on_hover_text(&tip);
    if value != default {
        let text = default.as_str().map_or_else(|| default.to_string(), str::to_owned);
        if ui.small_button("reset").on_hover_text(format!("back to {text}")).clicked() {
            chosen = Some(text);
        }
    }
    settings.set(&key.name, &chosen?).err().map(|error| error.to_string())
}

fn choice(
    ui: &mut Ui,
    id: &str,
    now: &str,
    names: impl Iterator<Item = String>,
    chosen: &mut Option<String>,
) -> egui::Response {
    let list = egui::ComboBox::from_id_salt(id).selected_text(now).width(96.0);
    list.show_ui(ui, |ui| {
        for name in names {
            if ui.selectable_label(name == now, &name).clicked() {
                *chosen = Some(name);
            }
        }
    })
    .response
}
