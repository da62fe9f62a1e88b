//! Shows pictures inside egui.

use std::sync::Arc;

use eframe::egui_wgpu::{CallbackResources, CallbackTrait};

use crate::present::Presenter;

/// Shows a composition inside egui.
pub(crate) struct PresentCallback {
    pub(crate) presenter: Arc<Presenter>,
    /// The bind group of the composition.
    pub(crate) bound: wgpu::BindGroup,
}

impl CallbackTrait for PresentCallback {
    fn paint(
        &self,
        _: eframe::egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _: &CallbackResources,
    ) {
        self.presenter.draw(pass, &self.bound);
    }
}
