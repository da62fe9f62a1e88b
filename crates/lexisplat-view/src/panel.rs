//! The panel beside the picture, with figures and controls.

use eframe::egui;
use egui::{Color32, CornerRadius, DragValue, Grid, Margin, RichText, ScrollArea, Slider, Ui};
use lexisplat::ShDegree;
use lexisplat::packed::Preset;
use lexisplat_eval::format;

use crate::app::App;
use crate::command::{Command, Mode, Quality, Slot};
use crate::keys;
use crate::models::{Job, OpenModel};
use crate::render_thread::{Frame, Score};
use crate::scene_renderer::DrawnPicture;

/// Width of the panel, in points.
const WIDTH: f32 = 304.0;
/// Width of sliders, in points.
const SLIDER: f32 = 130.0;
/// Space between sections, in points.
const GAP: f32 = 8.0;
/// Tolerances to choose from, as un-squared L2 norms of the error of a Gaussian's SH.
const TOLERANCES: [f64; 4] = [0.05, 0.1, 0.2, 0.5];
/// Colours of captions, of errors, and of the most important figures.
const QUIET: Color32 = Color32::from_gray(150);
const WRONG: Color32 = Color32::from_rgb(240, 130, 120);
const GOOD: Color32 = Color32::from_rgb(140, 205, 255);
/// Background colours of the panel and of its cards.
const BEHIND: Color32 = Color32::from_gray(27);
const CARD: Color32 = Color32::from_gray(36);

/// Shows the panel and returns the commands of its user.
pub(crate) fn show(app: &App, ui: &mut Ui) -> Vec<Command> {
    let mut commands = Vec::new();
    let frame = egui::Frame::new().fill(BEHIND).inner_margin(Margin::same(10));
    egui::Panel::right("panel").exact_size(WIDTH).resizable(false).frame(frame).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 5.0;
        ui.spacing_mut().slider_width = SLIDER;
        messages(app, ui);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            models(app, ui, &mut commands);
            view(app, ui, &mut commands);
            cameras(app, ui, &mut commands);
            drawing(app, ui, &mut commands);
            if let Some(frame) = &app.frame {
                numbers(app, frame, ui);
            }
            help(ui);
        });
    });
    commands
}

fn heading(ui: &mut Ui, title: &str) {
    ui.add_space(GAP);
    ui.label(RichText::new(title).color(QUIET).small().strong());
}

fn card(ui: &mut Ui, contents: impl FnOnce(&mut Ui)) {
    let frame =
        egui::Frame::new().fill(CARD).corner_radius(CornerRadius::same(5)).inner_margin(Margin::same(8));
    frame.show(ui, |ui| {
        ui.set_width(ui.available_width());
        contents(ui);
    });
}

fn models(app: &App, ui: &mut Ui, commands: &mut Vec<Command>) {
    for slot in Slot::BOTH {
        let (model, job) = (app.model(slot), app.jobs[slot.index()].as_ref());
        if model.is_none() && job.is_none() {
            continue;
        }
        card(ui, |ui| {
            if let Some(model) = model {
                about(ui, slot, model, app.model(slot.other()).map(AsRef::as_ref));
            }
            if let Some(job) = job {
                progress(ui, job);
            }
        });
    }
    ui.horizontal(|ui| {
        let can = app.model(Slot::First).is_some_and(|m| m.splats().is_some());
        let idle = app.jobs.iter().all(Option::is_none);
        ui.add_enabled_ui(can && idle, |ui| {
            ui.menu_button("Compress the first", |ui| qualities(ui, commands))
                .response
                .on_disabled_hover_text("the first model is not a PLY");
        });
        let both = app.models.iter().all(Option::is_some);
        if ui.add_enabled(both && idle, egui::Button::new("Swap")).clicked() {
            commands.push(Command::Swap);
        }
    });
}

fn about(ui: &mut Ui, slot: Slot, model: &OpenModel, other: Option<&OpenModel>) {
    let name = RichText::new(format!("{}  {}", slot.index() + 1, model.short_name())).strong();
    let whole = model.path.as_ref().map_or_else(|| model.scene.name.clone(), |p| p.display().to_string());
    ui.add(egui::Label::new(name).truncate()).on_hover_text(whole);
    let size = format::bytes(model.scene.bytes);
    ui.horizontal_wrapped(|ui| {
        ui.label(format!("{size}  {}", model.layout));
        let original = other.filter(|_| slot == Slot::Second);
        if let Some((ratio, of)) = model.ratio(original) {
            let smaller = RichText::new(format!("{ratio:.1}x smaller")).color(GOOD).strong();
            ui.label(smaller).on_hover_text(format!("smaller {of}, whole files"));
        }
    });
    let gaussians = format::count(model.gaussians() as u64);
    ui.label(RichText::new(format!("{gaussians} Gaussians, SH degree {}", model.degree())).color(QUIET));
    if let Some(guarantee) = &model.guarantee {
        ui.add(egui::Label::new(RichText::new(guarantee).color(QUIET)).wrap());
    }
}

fn progress(ui: &mut Ui, job: &Job) {
    let (label, share) = job.progress.read();
    let short = std::path::Path::new(&job.name).file_name().map(|n| n.to_string_lossy().into_owned());
    ui.add(egui::Label::new(short.unwrap_or_default()).truncate());
    let bar = egui::ProgressBar::new(share.unwrap_or(0.0)).text(label).desired_height(16.0);
    ui.add(bar.animate(share.is_none()));
    ui.ctx().request_repaint_after(std::time::Duration::from_millis(100));
}

fn qualities(ui: &mut Ui, commands: &mut Vec<Command>) {
    ui.label(RichText::new("everything, as precise as pictures need it").color(QUIET).small());
    for preset in Preset::ALL {
        if ui.button(format!("{preset}, about {} dB", preset.decibels())).clicked() {
            commands.push(Command::Compress(Quality::Preset(preset)));
            ui.close();
        }
    }
    ui.separator();
    ui.label(RichText::new("SH alone, within a tolerance").color(QUIET).small());
    for tolerance in TOLERANCES {
        if ui.button(format!("tolerance {tolerance}")).clicked() {
            commands.push(Command::Compress(Quality::Tolerance(tolerance)));
            ui.close();
        }
    }
}

fn view(app: &App, ui: &mut Ui, commands: &mut Vec<Command>) {
    let arrangement = app.state.arrangement();
    let both = app.models.iter().all(Option::is_some);
    heading(ui, "VIEW");
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for (mode, key) in Mode::ALL.into_iter().zip('1'..) {
            let possible = both || mode == arrangement.mode;
            let button = egui::Button::selectable(arrangement.mode == mode, mode.label());
            if ui.add_enabled(possible, button).on_hover_text(format!("key {key}")).clicked() {
                commands.push(Command::Mode(mode));
            }
        }
    });
    match arrangement.mode {
        Mode::Wipe => {
            let mut split = arrangement.split;
            if ui.add(Slider::new(&mut split, 0.0..=1.0).text("line").fixed_decimals(2)).changed() {
                commands.push(Command::Split(split));
            }
        }
        Mode::Difference => {
            let mut gain = arrangement.gain;
            let slider = Slider::new(&mut gain, 1.0..=100.0).logarithmic(true).max_decimals(1).text("times");
            if ui.add(slider).changed() {
                commands.push(Command::Gain(gain));
            }
        }
        _ => {}
    }
    if both && let Some(score) = app.score {
        let is_of_this = app.frame.as_ref().is_some_and(|frame| frame.score.is_some());
        ui.horizontal(|ui| {
            ui.label(RichText::new("PSNR of this view").color(QUIET));
            let text = match score {
                Score::Decibels(db) => format!("{db:.2} dB"),
                Score::Identical => "identical".to_owned(),
            };
            let colour = if is_of_this { GOOD } else { QUIET };
            ui.label(RichText::new(text).color(colour).strong().size(16.0));
        });
    }
}

fn cameras(app: &App, ui: &mut Ui, commands: &mut Vec<Command>) {
    let (cameras, free) = (app.state.cameras(), app.state.is_free());
    heading(ui, if app.given.is_some() { "CAMERAS" } else { "ORBIT" });
    ui.horizontal(|ui| {
        ui.add_enabled_ui(!cameras.is_empty(), |ui| {
            if ui.button("<").on_hover_text("key [").clicked() {
                commands.push(Command::StepCamera(-1));
            }
            if ui.button(">").on_hover_text("key ]").clicked() {
                commands.push(Command::StepCamera(1));
            }
            let mut index = app.state.index();
            let most = cameras.len().saturating_sub(1);
            if ui.add(DragValue::new(&mut index).range(0..=most)).changed() {
                commands.push(Command::Camera(index));
            }
            ui.label(RichText::new(format!("of {}", cameras.len())).color(QUIET));
            if ui.button("Reset").on_hover_text("key R").clicked() {
                commands.push(Command::Reset);
            }
        });
    });
    let name = match cameras.get(app.state.index()) {
        _ if free => "free".to_owned(),
        Some(camera) => format!("{}, {} x {}", camera.name, camera.width, camera.height),
        None => return,
    };
    ui.add(egui::Label::new(RichText::new(name).color(QUIET)).truncate());
    if ui.button("Save a screenshot").on_hover_text("key P").clicked() {
        commands.push(Command::Screenshot(None));
    }
}

fn drawing(app: &App, ui: &mut Ui, commands: &mut Vec<Command>) {
    heading(ui, "DRAWING");
    let most = app.models.iter().flatten().map(|m| m.degree()).max().unwrap_or(ShDegree::ZERO);
    let mut degree = app.state.options().max_degree.map_or(most.get(), |d| d.get().min(most.get()));
    if most > ShDegree::ZERO {
        let slider = Slider::new(&mut degree, 0..=most.get()).text("SH degree");
        if ui.add(slider).changed() {
            // The highest degree means no limit, so that a model of a higher degree that is opened later is drawn in
            // full.
            commands.push(Command::Degree(ShDegree::new(degree).ok().filter(|d| *d < most)));
        }
    }
    ui.horizontal(|ui| {
        let mut colour = app.state.options().background;
        if ui.color_edit_button_rgb(&mut colour).changed() {
            commands.push(Command::Background(colour));
        }
        for (name, colour) in [("black", [0.0; 3]), ("white", [1.0; 3])] {
            if ui.selectable_label(app.state.options().background == colour, name).clicked() {
                commands.push(Command::Background(colour));
            }
        }
        ui.label(RichText::new("background").color(QUIET));
    });
}

fn numbers(app: &App, frame: &Frame, ui: &mut Ui) {
    heading(ui, "NUMBERS");
    let pictures: Vec<&DrawnPicture> = frame.pictures.iter().flatten().map(AsRef::as_ref).collect();
    Grid::new("numbers").num_columns(3).spacing([12.0, 2.0]).show(ui, |ui| {
        let row = |ui: &mut Ui, name: &str, values: Vec<String>| {
            ui.label(RichText::new(name).color(QUIET));
            for value in values {
                ui.label(value);
            }
            ui.end_row();
        };
        let milliseconds = |time: f64| format!("{time:.1} ms");
        row(ui, "drawn", pictures.iter().map(|p| format::count(p.gaussians as u64)).collect());
        let stages = pictures.first().map(|p| p.stage_times.as_slice()).unwrap_or_default();
        for (stage, _) in stages {
            let times = pictures.iter().filter_map(|p| p.stage_times.iter().find(|(s, _)| s == stage));
            row(ui, stage, times.map(|(_, time)| milliseconds(*time)).collect());
        }
        let rate = 1e3 / frame.milliseconds.max(1e-3);
        row(ui, "frame", vec![milliseconds(frame.milliseconds), format!("{rate:.1} a second")]);
        let camera = &frame.view.camera;
        let (width, height) =
            pictures.first().map_or((camera.width, camera.height), |p| (p.picture.width, p.picture.height));
        row(ui, "picture", vec![format!("{width} x {height}")]);
        row(ui, "GPU memory", vec![format::bytes(frame.resident_bytes)]);
    });
    let by = RichText::new(format!("drawn by {}", app.render_thread.name)).color(QUIET);
    ui.add(egui::Label::new(by).truncate());
}

fn help(ui: &mut Ui) {
    ui.add_space(GAP);
    egui::CollapsingHeader::new(RichText::new("KEYS AND MOUSE").color(QUIET).small().strong())
        .default_open(false)
        .show(ui, |ui| {
            Grid::new("keys").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
                for (key, effect) in keys::HELP {
                    ui.label(RichText::new(key).strong());
                    ui.label(RichText::new(effect).color(QUIET));
                    ui.end_row();
                }
            });
            let drop = "A file dropped here becomes the second model, or the first with shift or if none is open. Two files become both.";
            ui.add(egui::Label::new(RichText::new(drop).color(QUIET)).wrap());
        });
}

fn messages(app: &App, ui: &mut Ui) {
    if app.messages.is_empty() {
        return;
    }
    let frame = egui::Frame::new().fill(BEHIND).inner_margin(Margin::symmetric(0, 6));
    egui::Panel::bottom("messages").frame(frame).show(ui, |ui| {
        for message in &app.messages {
            let colour = if message.is_error { WRONG } else { QUIET };
            ui.add(egui::Label::new(RichText::new(&message.text).color(colour)).wrap());
        }
    });
}
