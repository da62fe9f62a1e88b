//! One frame of the window: what happened since the last one, the parts that are shown, and the next command of the script.

use eframe::egui;

use crate::app::App;
use crate::panel;

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.process_events();
        self.keys(&context);
        self.dropped(&context);
        if self.state.panel() {
            for command in panel::show(self, ui) {
                self.handle(command);
            }
        }
        self.viewport(ui);
        self.request_frame(&context);
        if self.scripted && !self.quit && self.is_settled() {
            match self.script.pop_front() {
                Some(command) => self.handle(command),
                // The script has ended. Later errors are shown and do not end the program.
                None => self.scripted = false,
            }
            context.request_repaint();
        }
        if self.quit {
            context.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}
