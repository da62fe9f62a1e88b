//! The picture in the window, with its labels, the wipe's line, and the effects of the pointer on the view.

use std::sync::Arc;

use eframe::{egui, egui_wgpu};
use egui::{Align2, Color32, CornerRadius, CursorIcon, FontId, Pos2, Rect, Sense, Stroke, Vec2};

use crate::app::App;
use crate::camera_controller::fitted;
use crate::command::{Command, Mode, Slot};
use crate::gesture::Drag;
use crate::present::Composition;
use crate::present_callback::PresentCallback;
use crate::render_thread::Score;

/// Largest distance of the pointer from the wipe's line at which it drags the line, in points.
const GRIP: f32 = 8.0;
/// Radius of the line's handle, in points.
const HANDLE: f32 = 7.0;
/// Inner and outer margins of labels, in points.
const PADDING: Vec2 = Vec2::new(8.0, 4.0);
const MARGIN: f32 = 10.0;
/// Colour around the picture.
const BEHIND: Color32 = Color32::from_gray(16);

impl App {
    /// Shows the picture in the space that the panel leaves, and handles the pointer there.
    pub(crate) fn viewport(&mut self, ui: &mut egui::Ui) {
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let whole = ui.max_rect();
            let per_point = ui.ctx().pixels_per_point();
            self.area = (pixels(whole.width(), per_point), pixels(whole.height(), per_point));
            ui.painter().rect_filled(whole, CornerRadius::ZERO, BEHIND);
            let picture = self.composition().and_then(|composition| {
                let place = self.place(&composition, whole, per_point)?;
                let presenter = Arc::clone(&self.presenter);
                let bound = presenter.bind(&composition)?;
                let callback = PresentCallback { presenter, bound };
                ui.painter().add(egui_wgpu::Callback::new_paint_callback(place, callback));
                Some((place, composition.arrangement.mode))
            });
            let response = ui.interact(whole, ui.scope_id().with("viewport"), Sense::click_and_drag());
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

    /// Returns the pictures in the chosen arrangement. If the arrangement needs a picture that is missing, returns the
    /// only picture.
    fn composition(&self) -> Option<Composition> {
        let frame = self.frame.as_ref()?;
        let pictures = frame.pictures.each_ref().map(|drawn| drawn.as_ref().map(|d| d.picture.clone()));
        let mut composition = Composition { arrangement: self.state.arrangement(), pictures };
        if composition.sides().is_none() {
            let there = Slot::BOTH.into_iter().find(|slot| composition.pictures[slot.index()].is_some())?;
            composition.arrangement.mode = Mode::One(there);
        }
        Some(composition)
    }

    /// Returns the rectangle of the picture. It is in the middle of `whole`, and its corners are on whole pixels.
    fn place(&self, composition: &Composition, whole: Rect, per_point: f32) -> Option<Rect> {
        let camera = &self.frame.as_ref()?.view.camera;
        let columns = composition.arrangement.columns();
        let (width, height) = (camera.width * columns, camera.height);
        // A picture that was drawn for this area is shown pixel for pixel. A picture that was drawn before the window
        // changed its size is scaled until the next picture is drawn.
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
        let line = place.left() + place.width() * self.state.arrangement().split;
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
                self.handle(Command::Split((at.x - place.left()) / place.width().max(1.0)));
            }
        } else if response.dragged() && by != Vec2::ZERO {
            let primary = response.dragged_by(egui::PointerButton::Primary);
            let drag = match (primary, modifiers.shift, modifiers.ctrl) {
                (true, false, false) => Drag::Orbit,
                (true, false, true) => Drag::Look,
                _ => Drag::Pan,
            };
            self.state.drag(drag, x, y);
            self.note_motion();
        }
        let wheel = ui.input(egui::InputState::smooth_scroll_delta).y;
        if response.hovered() && wheel != 0.0 {
            self.state.scroll(f64::from(wheel));
            self.note_motion();
        }
    }

    fn overlays(&self, painter: &egui::Painter, place: Rect, mode: Mode) {
        let name = |slot: Slot| self.model(slot).map(|m| m.short_name()).unwrap_or_default();
        let (left, right) = (place.left_top(), place.right_top());
        match mode {
            Mode::One(slot) => label(painter, left, Align2::LEFT_TOP, &name(slot)),
            Mode::SideBySide | Mode::Wipe => {
                let share = if mode == Mode::Wipe { self.state.arrangement().split } else { 0.5 };
                let x = place.left() + place.width() * share;
                let stroke = Stroke::new(1.5, Color32::WHITE);
                painter.vline(x, place.y_range(), Stroke::new(3.5, Color32::from_black_alpha(90)));
                painter.vline(x, place.y_range(), stroke);
                if mode == Mode::Wipe {
                    let handle = Pos2::new(x, place.center().y);
                    painter.circle(handle, HANDLE, Color32::from_gray(40), stroke);
                }
                label(painter, left, Align2::LEFT_TOP, &name(Slot::First));
                label(painter, right, Align2::RIGHT_TOP, &name(Slot::Second));
            }
            Mode::Difference => {
                let text = format!("difference x {:.3}", self.state.arrangement().gain);
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
        let busy = self.jobs.iter().any(Option::is_some) || self.models.iter().any(Option::is_some);
        let text = if busy { "reading ..." } else { "drop a .ply or .lexi file here" };
        middle(painter, whole, text, Color32::from_gray(150));
    }
}

/// Writes text in the middle of `place`.
fn middle(painter: &egui::Painter, place: Rect, text: &str, colour: Color32) {
    painter.text(place.center(), Align2::CENTER_CENTER, text, FontId::proportional(18.0), colour);
}

/// Writes text over the picture. `corner` is the place of its corner `align`; the text lies inside of it.
fn label(painter: &egui::Painter, corner: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(13.0), Color32::WHITE);
    let sign = align.to_sign();
    let anchor = corner - sign * (PADDING + Vec2::splat(MARGIN));
    let inner = align.anchor_size(anchor, galley.size());
    painter.rect_filled(inner.expand2(PADDING), CornerRadius::same(4), Color32::from_black_alpha(150));
    painter.galley(inner.min, galley, Color32::WHITE);
}

/// Returns the number of whole pixels in `points`.
fn pixels(points: f32, per_point: f32) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65535")]
    let count = (points * per_point).floor().clamp(0.0, 65_535.0) as u32;
    count
}
