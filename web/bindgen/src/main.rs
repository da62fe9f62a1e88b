//! `lexisplat-bindgen IN.wasm FOLDER NAME`: writes NAME.js, NAME_bg.wasm and types for `IN.wasm`, as `wasm-bindgen --target
//! web` does. It builds in less time than that program.

use anyhow::{Result, bail};
use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, folder, name] = arguments.as_slice() else { bail!("usage: lexisplat-bindgen IN.wasm FOLDER NAME") };
    let mut bindgen = Bindgen::new();
    bindgen.web(true)?.typescript(true).remove_producers_section(true).input_path(input).out_name(name);
    bindgen.generate(folder)
}
