// Reading one resource over HTTP or HTTPS (libcurl), from servers that are not trusted: limits on time and size, no
// redirect to another server (scheme, host or port), no compressed answers. Blocks; call it from a thread of its own.
// Any thread may call.
#pragma once
#include "base/status.h"

// ---------------------------------------------------------------- addresses

// Addresses (http://USER:PASSWORD@HOST:PORT/PATH?QUERY) as they may be kept and shown: a password in one is for the
// request alone, never for a file, a page or a sentence that others see.

// Takes USER:PASSWORD@ out of it. Other text stays as it is.
void address_hide_user(char *address);

// The address for sentences: without user and password, and with … for a query, which may be a key; cut to fit.
enum { ADDRESS_SHOWN_BYTES = 256 };
const char *address_shown(const char *address, char out[ADDRESS_SHOWN_BYTES]);

// ---------------------------------------------------------------- requests

struct http_limits {
    int connect_ms, total_ms; // 3000, 10000
    size_t most_bytes;        // of the answer's body: 4 MiB
    const char *login; // an address on this server whose user and password go with the request; NULL: the url's own
    const char *authorities; // file of certificates to trust instead of the system's; NULL: the system's
};
struct http_limits http_default_limits(void);

struct http_answer {
    bool unchanged; // the server has nothing newer than `etag`; there is no body
    char etag[128]; // "" if it gave none
    uint8_t *body;  // malloc'ed with a 0 after its `count` bytes; the caller frees it
    size_t count;
};

// False: this program was built without libcurl, and http_get always fails.
bool http_available(void);

// etag: of what is known already, or NULL. ERR_MISSING: the server says there is nothing (404, 410). ERR_IO: no
// connection, too slow, another error of the server, a certificate that is not trusted. ERR_INPUT: not an http(s)
// address, too large, or redirected elsewhere. ERR_MEMORY. Each with a sentence that names the address, as
// address_shown() does. On error *out is all 0.
MUST_CHECK enum status http_get(const char *url, const char *etag, const struct http_limits *limits,
                                struct http_answer *out);

// `reference` (absolute or relative) seen from `base`, without user and password. ERR_INPUT: no valid address, another
// scheme than http or https, or another server than base's (scheme, host and port); with a sentence.
MUST_CHECK enum status http_resolve(const char *base, const char *reference, char *out, size_t bytes);
