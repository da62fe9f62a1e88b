/** Why an address could not be fetched. Browsers give scripts the same error for every reason, so others are asked. */

/** Milliseconds that a server has to say that it is there. */
const PATIENCE = 5000;
/** Codes of Node's errors. */
const CODES = {
  ECONNREFUSED: 'the server refuses connections',
  ECONNRESET: 'the server closed the connection',
  ENOTFOUND: 'there is no server of this name',
  EAI_AGAIN: 'the name of the server could not be looked up',
};

/**
 * @param {string | URL} address what could not be fetched
 * @param {any} cause the error of `fetch`
 * @returns {Promise<string>} the reason, to follow a name and a colon
 */
export async function whyUnreachable(address, cause) {
  const code = cause?.cause?.code ?? cause?.code;
  if (typeof code === 'string') return CODES[code] ?? `it could not be fetched (${code})`;
  if (typeof location === 'undefined') return 'it could not be fetched';
  let url;
  try {
    url = new URL(address, document.baseURI);
  } catch {
    return 'this is no address';
  }
  if (url.protocol === 'file:') return 'browsers do not let pages read addresses of files; open the file itself';
  if (!/^https?:$/.test(url.protocol)) return 'it could not be fetched';
  if (navigator.onLine === false) return 'this device is offline';
  const { answers, isForbidden } = await asked(url);
  if (isForbidden) return "the page's content security policy does not allow this address (connect-src)";
  if (answers && url.origin !== location.origin) {
    return `${url.host} does not allow other sites to read it: it has to answer with Access-Control-Allow-Origin (CORS)`;
  }
  if (location.protocol === 'https:' && url.protocol === 'http:') return 'pages from https: may not load from http:';
  return `${url.host} does not answer: it refuses connections, or is not there`;
}

/** Whether anything answers at an address, even if the page may not read it, and whether the page may not ask. */
async function asked(url) {
  let isForbidden = false;
  const note = ({ blockedURI }) => (isForbidden ||= blockedURI === url.href || blockedURI === url.origin);
  document.addEventListener('securitypolicyviolation', note);
  try {
    await fetch(url, { mode: 'no-cors', method: 'HEAD', cache: 'no-store', signal: AbortSignal.timeout(PATIENCE) });
    return { answers: true, isForbidden };
  } catch {
    // The event comes after the error.
    await new Promise((go) => setTimeout(go));
    return { answers: false, isForbidden };
  } finally {
    document.removeEventListener('securitypolicyviolation', note);
  }
}
