//! Parts of scenes in the form that the GPU holds. Workers make them.

use js_sys::{Function, Uint8Array};
use lexisplat::Silent;
use lexisplat::ply::ReadOptions;
use lexisplat_formats::{Opened, Siblings};
use lexisplat_render::Scene;
use lexisplat_render::gpu::{SceneForm, ScenePart};
use serde_json::json;
use wasm_bindgen::prelude::*;

use crate::chunk::Chunk;
use crate::{limits, thrown};

/// Number of Gaussians of a part of a scene that is read whole. With dense SH of degree 3 a part takes 16 MB on the GPU.
const PART: usize = 65_536;

#[wasm_bindgen]
impl Chunk {
    /// Returns the chunk in the form that the GPU holds, for `Viewer.part`.
    ///
    /// # Errors
    /// An error if it is larger than WebAssembly can address.
    pub fn part(&self) -> Result<Uint8Array, JsError> {
        bytes_of(&Scene::from(self.model()))
    }

    /// Returns the data that all chunks of the scene share on the GPU, for `Viewer.form`.
    #[must_use]
    pub fn form(&self) -> Vec<u8> {
        SceneForm::of(&Scene::from(self.model())).to_bytes()
    }
}

/// Reads the scene in `bytes`, of any format that lexisplat reads. Errors call it `name`. Calls `on_form` with the form
/// of the scene and facts about the file as JSON, then `on_part` with the number, the bytes and the number of Gaussians
/// of each part.
///
/// # Errors
/// An error that tells what is wrong with the bytes, and errors that the functions throw.
#[wasm_bindgen]
pub fn open_scene(name: &str, bytes: &[u8], on_form: &Function, on_part: &Function) -> Result<(), JsValue> {
    let options = ReadOptions::default().with_limits(limits());
    let refused = |error: lexisplat::Error| JsValue::from(thrown(error));
    let opened =
        lexisplat_formats::open(name, bytes, Siblings::NONE, &options, false, &Silent).map_err(refused)?;
    let source = opened.source();
    let head = json!({
        "layout": layout(&opened),
        "gaussians": source.len(),
        "sourceGaussians": source.len(),
        "bytes": bytes.len(),
        "degree": source.empty().degree.get(),
        "warnings": source.warnings(),
    });
    let head = JsValue::from(head.to_string());
    let give_form = |scene: &Scene<'_>| -> Result<(), JsValue> {
        let form = Uint8Array::from(SceneForm::of(scene).to_bytes().as_slice());
        on_form.call2(&JsValue::NULL, &form, &head).map(drop)
    };
    let give_part = |index: usize, scene: &Scene<'_>| -> Result<(), JsValue> {
        let number = |n: usize| JsValue::from(u32::try_from(n).unwrap_or(u32::MAX));
        on_part
            .call3(&JsValue::NULL, &number(index), &bytes_of(scene)?.into(), &number(scene.len()))
            .map(drop)
    };
    if let Opened::Lexi(reader) = &opened {
        // Sparse codes are kept.
        let mut failed = Ok(());
        let mut index = 0;
        let read = reader.each(&mut |_, model| {
            let scene = Scene::from(&model);
            failed = if index == 0 { give_form(&scene) } else { Ok(()) };
            failed = std::mem::replace(&mut failed, Ok(())).and_then(|()| give_part(index, &scene));
            index += 1;
            match failed {
                Ok(()) => Ok(()),
                // The reader stops at an error. The error stored above is returned instead of this one.
                Err(_) => Err(lexisplat::Error::parameter("part", index, "a part that is taken")),
            }
        });
        failed?;
        read.map_err(refused)?;
        if index == 0 {
            give_form(&Scene::from(&reader.model().map_err(refused)?))?;
        }
        return Ok(());
    }
    let mut splats = source.empty();
    give_form(&Scene::from(&splats))?;
    for (index, first) in (0..source.len()).step_by(PART).enumerate() {
        source.read(first..(first + PART).min(source.len()), &mut splats).map_err(refused)?;
        give_part(index, &Scene::from(&splats))?;
    }
    Ok(())
}

fn layout(opened: &Opened<'_>) -> String {
    match opened {
        Opened::Lexi(reader) => reader.layout().to_string(),
        other => other.kind().to_string(),
    }
}

fn bytes_of(scene: &Scene<'_>) -> Result<Uint8Array, JsError> {
    let part = ScenePart::new(scene).map_err(thrown)?;
    Ok(Uint8Array::from(part.as_bytes()))
}
