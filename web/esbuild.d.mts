/** A plugin of esbuild that puts the WebAssembly and the workers of the package beside the bundle, whose format is 'esm'. */
export default function lexisplat(): { name: string; setup: (build: any) => void };
