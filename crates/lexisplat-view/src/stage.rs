//! The picture in the window: pointer, letterbox, labels, and the wipe's line.

use std::sync::Arc;

use eframe::{egui, egui_wgpu};
use egui::{Align2, Color32, CornerRadius, CursorIcon, FontId, Pos2, Rect, Sense, Stroke, Vec2};

use crate::app::App;
use crate::command::{Command, Mode, Which};
use crate::eye::fitted;
use crate::painting::Score;
use crate::present::{OnScreen, Showing};

/// Orbit of a drag across the picture's shorter side, in radians.
const ORBIT: f64 = std::f64::consts::PI;
/// Turn of the head for the same drag, in radians.
const LOOK: f64 = 1.0;
/// Distance left after one point of wheel.
const WHEEL: f64 = 0.998;
/// How near to the wipe's line the pointer drags it, in points.
const GRIP: f32 = 8.0;
/// Radius of the line's handle, in points.
const HANDLE: f32 = 7.0;
/// Inner and outer margins of labels, in points.
const PADDING: Vec2 = Vec2::new(8.0, 4.0);
const MARGIN: f32 = 10.0;
/// Around the picture.
const BEHIND: Color32 = Color32::from_gray(16);

impl App {
    /// Shows the picture in all the space that is left, and takes the pointer there.
    pub(crate) fn stage(&mut self, ui: &mut egui::Ui) {
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let whole = ui.max_rect();
            let per_point = ui.ctx().pixels_per_point();
            self.area = (pixels(whole.width(), per_point), pixels(whole.height(), per_point));
            ui.painter().rect_filled(whole, CornerRadius::ZERO, BEHIND);
            let picture = self.showing().and_then(|showing| {
                let place = self.place(&showing, whole, per_point)?;
                let mode = showing.arrangement.mode;
                let presenter = Arc::clone(&self.presenter);
                ui.painter()
                    .add(egui_wgpu::Callback::new_paint_callback(place, OnScreen { presenter, showing }));
                Some((place, mode))
            });
            let response = ui.interact(whole, ui.scope_id().with("stage"), Sense::click_and_drag());
            match picture {
                Some((place, mode)) => {
                    self.pointer(ui, &response, place, mode);
                    self.overlays(ui.painter(), place, mode);
                }
                None => self.waiting(ui.painter(), whole),
            }
            let hovering = ui.input(|input| !input.raw.hovered_files.is_empty());
            if hovering {
                ui.painter().rect_filled(whole, CornerRadius::ZERO, Color32::from_black_alpha(150));
                let what = match self.models[0] {
                    Some(_) => "drop: the second model (with shift: the first)",
                    None => "drop: the first model",
                };
                middle(ui.painter(), whole, what, Color32::WHITE);
            }
        });
    }

    /// What can be shown now: the arrangement asked for, or what there is a picture of.
    fn showing(&self) -> Option<Showing> {
        let shot = self.shot.as_ref()?;
        let mut showing = Showing { arrangement: self.state.arrangement, pictures: shot.pictures.clone() };
        if showing.sides().is_none() {
            let there = Which::BOTH.into_iter().find(|which| showing.pictures[which.index()].is_some())?;
            showing.arrangement.mode = Mode::One(there);
        }
        Some(showing)
    }

    /// Where on screen: on whole pixels, in the middle of `whole`.
    fn place(&self, showing: &Showing, whole: Rect, per_point: f32) -> Option<Rect> {
        let camera = &self.shot.as_ref()?.view.camera;
        let columns = showing.arrangement.columns();
        let (width, height) = (camera.width * columns, camera.height);
        // Drawn for this area, pixel for pixel; or for another one, until the next picture comes.
        let fills = self.area.0.checked_sub(width).is_some_and(|rest| rest < columns);
        let fits = (fills && height <= self.area.1) || (width <= self.area.0 && height == self.area.1);
        let aspect = f64::from(width) / f64::from(height.max(1));
        let (width, height) = if fits { (width, height) } else { fitted(aspect, self.area.0, self.area.1) };
        let snapped = |start: f32, space: u32, size: u32| {
            ((start * per_point).round() + (space.saturating_sub(size) / 2) as f32) / per_point
        };
        let corner =
            Pos2::new(snapped(whole.min.x, self.area.0, width), snapped(whole.min.y, self.area.1, height));
        Some(Rect::from_min_size(corner, Vec2::new(width as f32, height as f32) / per_point))
    }

    fn pointer(&mut self, ui: &egui::Ui, response: &egui::Response, place: Rect, mode: Mode) {
        let line = place.left() + place.width() * self.state.arrangement.split;
        let near_line = |at: Pos2| mode == Mode::Wipe && (at.x - line).abs() <= GRIP && place.contains(at);
        let (modifiers, origin) = ui.input(|i| (i.modifiers, i.pointer.press_origin()));
        if response.drag_started_by(egui::PointerButton::Primary) {
            self.dragging_split = origin.is_some_and(near_line);
        }
        if !response.dragged() {
            self.dragging_split = false;
        }
        if self.dragging_split || response.hover_pos().is_some_and(near_line) {
            ui.ctx().set_cursor_icon(CursorIcon::ResizeHorizontal);
        }
        let short = f64::from(place.width().min(place.height()).max(1.0));
        let by = response.drag_delta();
        let (x, y) = (f64::from(by.x) / short, f64::from(by.y) / short);
        if self.dragging_split {
            if let Some(at) = response.interact_pointer_pos() {
                self.perform(Command::Split((at.x - place.left()) / place.width().max(1.0)));
            }
        } else if response.dragged() && by != Vec2::ZERO {
            let primary = response.dragged_by(egui::PointerButton::Primary);
            if let Some(eye) = self.state.eye() {
                match (primary, modifiers.shift, modifiers.ctrl) {
                    (true, false, false) => eye.orbit(x * ORBIT, y * ORBIT),
                    (true, false, true) => eye.look(x * -LOOK, y * -LOOK),
                    _ => eye.pan(x, y),
                }
            }
            self.moved();
        }
        let wheel = ui.input(egui::InputState::smooth_scroll_delta).y;
        if response.hovered() && wheel != 0.0 {
            if let Some(eye) = self.state.eye() {
                eye.dolly(WHEEL.powf(f64::from(wheel)));
            }
            self.moved();
        }
    }

    fn overlays(&self, painter: &egui::Painter, place: Rect, mode: Mode) {
        let name = |which: Which| self.model(which).map(|m| m.short_name()).unwrap_or_default();
        let (left, right) = (place.left_top(), place.right_top());
        match mode {
            Mode::One(which) => label(painter, left, Align2::LEFT_TOP, &name(which)),
            Mode::SideBySide | Mode::Wipe => {
                let share = if mode == Mode::Wipe { self.state.arrangement.split } else { 0.5 };
                let x = place.left() + place.width() * share;
                let stroke = Stroke::new(1.5, Color32::WHITE);
                painter.vline(x, place.y_range(), Stroke::new(3.5, Color32::from_black_alpha(90)));
                painter.vline(x, place.y_range(), stroke);
                if mode == Mode::Wipe {
                    let handle = Pos2::new(x, place.center().y);
                    painter.circle(handle, HANDLE, Color32::from_gray(40), stroke);
                }
                label(painter, left, Align2::LEFT_TOP, &name(Which::First));
                label(painter, right, Align2::RIGHT_TOP, &name(Which::Second));
            }
            Mode::Difference => {
                let text = format!("difference x {:.3}", self.state.arrangement.gain);
                label(painter, left, Align2::LEFT_TOP, text.trim_end_matches('0').trim_end_matches('.'));
            }
        }
        let text = match self.score {
            Some(Score::Decibels(db)) => format!("PSNR {db:.2} dB"),
            Some(Score::Identical) => "identical".to_owned(),
            None => return,
        };
        if !matches!(mode, Mode::One(_)) {
            label(painter, place.left_bottom(), Align2::LEFT_BOTTOM, &text);
        }
    }

    fn waiting(&self, painter: &egui::Painter, whole: Rect) {
        let busy = self.works.iter().any(Option::is_some) || self.models.iter().any(Option::is_some);
        let text = if busy { "reading ..." } else { "drop a .ply or .lexi file here" };
        middle(painter, whole, text, Color32::from_gray(150));
    }
}

/// Words in the middle of `place`.
fn middle(painter: &egui::Painter, place: Rect, text: &str, colour: Color32) {
    painter.text(place.center(), Align2::CENTER_CENTER, text, FontId::proportional(18.0), colour);
}

/// Words over the picture, in the corner `align` of it at `corner`.
fn label(painter: &egui::Painter, corner: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(13.0), Color32::WHITE);
    let sign = align.to_sign();
    let anchor = corner - sign * (PADDING + Vec2::splat(MARGIN));
    let inner = align.anchor_size(anchor, galley.size());
    painter.rect_filled(inner.expand2(PADDING), CornerRadius::same(4), Color32::from_black_alpha(150));
    painter.galley(inner.min, galley, Color32::WHITE);
}

/// Whole pixels in so many points.
fn pixels(points: f32, per_point: f32) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65535")]
    let count = (points * per_point).floor().clamp(0.0, 65_535.0) as u32;
    count
}
