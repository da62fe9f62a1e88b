// The results of decoders.mjs, as Markdown.

const median = (values) => {
  const sorted = [...values].sort((a, b) => a - b);
  const middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
};

const fastest = (jobs) => [...jobs].sort((a, b) => median(a.times) - median(b.times))[0];

/** Millions of Gaussians a second. */
const rate = (gaussians, ms) => gaussians / ms / 1000;

/**
 * @param {object} result of decoders.mjs
 * @returns {string} the table, what could not be measured, and whether ours is faster and smaller than SPZ
 */
export function report(result) {
  const { files, jobs, source, packages, processor, rounds } = result;
  const lines = [`${result.scene.split('/').pop()}: ${source} Gaussians; medians of ${rounds} rounds; ${processor}; ${packages.join(', ')}`, ''];
  lines.push(`PSNR is of ${Object.values(files)[0].views} views against the PLY, by this program. ${chunksOf(files)}`, '');
  lines.push('| file | bytes | Gaussians | PSNR, dB: mean (worst) | decoder: what it gives | one thread, M Gaussians of the source a second (of the file) | workers | bytes on the GPU a Gaussian of the source |');
  lines.push('|---|---|---|---|---|---|---|---|');
  for (const [name, { bytes, gaussians, psnr }] of Object.entries(files)) {
    let about = [name, bytes, gaussians, `${psnr.mean.toFixed(2)} (${psnr.min.toFixed(2)})`];
    const rows = [...new Set(jobs.filter(({ file }) => file === name).map(({ row }) => row))];
    for (const row of rows) {
      const ours = jobs.filter((job) => job.file === name && job.row === row);
      const cell = (...columns) => ours.filter(({ column }) => columns.includes(column)).map((job) => rates(job, result)).join(', ') || '-';
      lines.push(`| ${[...about, row, cell('one'), cell('two', 'worker', 'browser'), onGpu(name, row, ours, result)].join(' | ')} |`);
      about = ['', '', '', ''];
    }
  }
  const failed = jobs.filter(({ error }) => error);
  if (failed.length > 0) lines.push('', 'Not measured:', ...failed.map(({ file, row, error }) => `- ${file}, ${row}: ${error.split('\n')[0]}`));
  return [...lines, '', ...milliseconds(jobs), '', ...verdict(result)].join('\n');
}

// Decoders beside the page's thread.
const NOTES = { two: '2 of ours', worker: '1 of Spark’s', browser: 'the browser’s own' };
const COLUMNS = { one: 'one', ...NOTES };

function chunksOf(files) {
  const known = Object.entries(files).filter(([, { chunks }]) => chunks !== undefined);
  return `Chunks, which workers share: ${known.map(([name, { chunks }]) => `${chunks} of ${name}`).join(', ')}.`;
}

function rates({ times, error, column, gaussians }, { source }) {
  if (error) return 'not measured';
  const ms = median(times);
  const whole = rate(source, ms).toFixed(2);
  const own = gaussians === source ? whole : `${whole} (${rate(gaussians, ms).toFixed(2)})`;
  return NOTES[column] ? `${own}, ${NOTES[column]}` : own;
}

function onGpu(name, row, jobs, { gpu, source }) {
  const each = (bytes) => (bytes / source).toFixed(1);
  const textures = jobs.find((job) => job.gpu !== undefined && !job.options.isFloats)?.gpu;
  if (textures !== undefined) return each(textures);
  if (row.startsWith('lexisplat, open: floats, SH as codes') && gpu.ours[name]) {
    const { geometry, sh } = gpu.ours[name];
    return `${each(geometry + sh)} in our viewer (${each(sh)} of them SH)`;
  }
  if (row.startsWith('Spark, PackedSplats') && typeof gpu.spark === 'number' && !jobs[0].error) return each(gpu.spark);
  return '-';
}

// Milliseconds, for machines that also do something else: the fastest round tells what load did to the median.
function milliseconds(jobs) {
  const measured = jobs.filter(({ error, times }) => !error && times.length > 0);
  const row = ({ file, row, column, times }) => `| ${file} | ${row} | ${COLUMNS[column]} | ${median(times).toFixed(0)} | ${Math.min(...times).toFixed(0)} |`;
  return ['| file | decoder | threads | median, ms | fastest, ms |', '|---|---|---|---|---|', ...measured.map(row)];
}

// Largest share of the bytes of SPZ that ours may have.
const SHARE = 0.5;

// Ours by itself beside each decoder of SPZ on one thread, and the bytes.
function verdict({ files, jobs, source }) {
  const measured = jobs.filter(({ error, times, column }) => !error && times.length > 0 && column === 'one');
  const peers = measured.filter(({ file }) => file.startsWith('SPZ'));
  const [other, spz] = Object.entries(files).filter(([name]) => name.startsWith('SPZ')).sort((a, b) => a[1].bytes - b[1].bytes)[0];
  const named = ({ file, row }) => `${file} by ${row}`;
  const lines = [`| rate, times that of SPZ: by Gaussians of the source (of the file) | ${peers.map(named).join(' | ')} |`, `|---|${peers.map(() => '---|').join('')}`];
  const verdicts = [];
  for (const [name, file] of Object.entries(files).filter(([name]) => name.startsWith('.lexi'))) {
    const ours = measured.filter((job) => job.file === name && job.name === 'alone');
    for (const own of ours) {
      const times = peers.map((peer) => median(peer.times) / median(own.times));
      lines.push(`| ${name}: ${own.row} | ${times.map((t) => `${t.toFixed(2)} (${((t * own.gaussians) / source).toFixed(2)})`).join(' | ')} |`);
    }
    const share = file.bytes / spz.bytes;
    const above = file.psnr.mean - spz.psnr.mean;
    const isSmall = share <= SHARE && above >= 0;
    verdicts.push(`- ${name}: ${(100 * share).toFixed(1)} % of the bytes of ${other}, ${above.toFixed(2)} dB above it: at most half its bytes at its PSNR ${isSmall ? 'holds' : 'does not hold'}.`);
    const best = fastest(ours);
    const quicker = best ? peers.filter((peer) => median(peer.times) <= median(best.times)).map(named) : [];
    const judgement = !best || peers.length === 0 ? 'was not measured' : quicker.length === 0 ? 'holds' : `does not hold: as fast or faster are ${quicker.join('; ')}`;
    verdicts.push(`- ${name}: faster than SPZ a Gaussian of the source on one thread, at its best, ${judgement}.`);
  }
  return [...lines, '', ...verdicts];
}
