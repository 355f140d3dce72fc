#include "platform/network/http_client.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

// ---------------------------------------------------------------- addresses

// Where USER:PASSWORD@HOST begins, as libcurl sees it: after SCHEME: and one to three slashes, or after two.
static size_t authority_start(const char *address)
{
    size_t at = 0;
    while (isalnum((unsigned char)address[at]) || (at && address[at] && strchr("+-.", address[at])))
        at++;
    at = at && address[at] == ':' ? at + 1 : 0;
    const size_t slashes = strspn(address + at, "/");
    return slashes >= (at ? 1 : 2) ? at + slashes : strlen(address);
}

void address_hide_user(char *address)
{
    char *begin = address + authority_start(address), *host = begin;
    const char *end = begin + strcspn(begin, "/?#\\");
    for (char *at = begin; at < end; at++)
        if (*at == '@')
            host = at + 1;
    memmove(begin, host, strlen(host) + 1);
}

const char *address_shown(const char *address, char out[ADDRESS_SHOWN_BYTES])
{
    char whole[4096];
    snprintf(whole, sizeof whole, "%s", address); // before it is cut: what is cut off may hold the @
    address_hide_user(whole);
    const size_t from = authority_start(whole), length = strcspn(whole + from, "?") + from;
    const size_t max = ADDRESS_SHOWN_BYTES - 8; // the rest is for the signs behind it
    const size_t shown = length < max ? length : max;
    const char *left_out = whole[length] ? "?…" : "";
    snprintf(out, ADDRESS_SHOWN_BYTES, "%.*s%s", (int)shown, whole, shown < length ? "…" : left_out);
    return out;
}

// ---------------------------------------------------------------- requests

struct http_limits http_default_limits(void) { return (struct http_limits){3000, 10000, 4 << 20, NULL, NULL}; }

#ifdef HAVE_CURL

#include <curl/curl.h>
#include <pthread.h>

enum { ADDRESS_MAX = 2048 }; // bytes, with the 0 at the end

static void start_curl(void) { curl_global_init(CURL_GLOBAL_DEFAULT); }

static pthread_once_t once = PTHREAD_ONCE_INIT;

bool http_available(void) { return true; }

struct transfer {
    struct http_answer *answer;
    size_t most, capacity;
    bool too_large, no_memory;
};

static size_t take_body(char *bytes, size_t size, size_t n, void *user)
{
    struct transfer *t = user;
    struct http_answer *a = t->answer;
    n *= size;
    if (n > t->most - a->count) {
        t->too_large = true;
        return 0;
    }
    if (a->count + n + 1 > t->capacity) {
        const size_t capacity = 2 * (a->count + n) + 4096;
        uint8_t *grown = realloc(a->body, capacity);
        if (!grown) {
            t->no_memory = true;
            return 0;
        }
        a->body = grown;
        t->capacity = capacity;
    }
    memcpy(a->body + a->count, bytes, n);
    a->count += n;
    a->body[a->count] = 0;
    return n;
}

static size_t take_header(char *line, size_t size, size_t n, void *user)
{
    struct transfer *t = user;
    static const char name[] = "etag:";
    n *= size;
    if (n <= sizeof name - 1 || strncasecmp(line, name, sizeof name - 1))
        return n;
    size_t from = sizeof name - 1, to = n;
    while (from < to && (line[from] == ' ' || line[from] == '\t'))
        from++;
    while (to > from && (line[to - 1] == '\r' || line[to - 1] == '\n' || line[to - 1] == ' '))
        to--;
    if (to - from < sizeof t->answer->etag) {
        memcpy(t->answer->etag, line + from, to - from);
        t->answer->etag[to - from] = 0;
    }
    return n;
}

// The part of an address, decoded, "" if there is none.
static void url_part(const char *url, CURLUPart part, char *out, size_t bytes)
{
    const unsigned how = part == CURLUPART_PORT ? CURLU_DEFAULT_PORT : CURLU_URLDECODE;
    CURLU *u = curl_url();
    char *text = NULL;
    out[0] = 0;
    if (u && !curl_url_set(u, CURLUPART_URL, url, 0) && !curl_url_get(u, part, &text, how) && text)
        snprintf(out, bytes, "%s", text);
    curl_free(text);
    curl_url_cleanup(u);
}

// Whether both are on one server, as browsers see it: what lies at another port may be this computer's own.
static bool same_server(const char *a, const char *b)
{
    static const CURLUPart parts[] = {CURLUPART_HOST, CURLUPART_SCHEME, CURLUPART_PORT};
    for (size_t i = 0; i < COUNT_OF(parts); i++) {
        char of_a[256], of_b[256];
        url_part(a, parts[i], of_a, sizeof of_a);
        url_part(b, parts[i], of_b, sizeof of_b);
        if (!of_a[0] || strcasecmp(of_a, of_b) != 0)
            return false;
    }
    return true;
}

static bool is_web(const char *url)
{
    char scheme[16], host[256];
    url_part(url, CURLUPART_SCHEME, scheme, sizeof scheme);
    url_part(url, CURLUPART_HOST, host, sizeof host);
    return (!strcmp(scheme, "http") || !strcmp(scheme, "https")) && host[0];
}

enum status http_resolve(const char *base, const char *reference, char *out, size_t bytes)
{
    pthread_once(&once, start_curl);
    char of[ADDRESS_SHOWN_BYTES], what[ADDRESS_SHOWN_BYTES];
    CURLU *u = curl_url();
    char *text = NULL;
    enum status status = OK;
    address_shown(base, of);
    address_shown(reference, what);
    if (!u || curl_url_set(u, CURLUPART_URL, base, 0) || curl_url_set(u, CURLUPART_URL, reference, 0) ||
        curl_url_set(u, CURLUPART_USER, NULL, 0) || curl_url_set(u, CURLUPART_PASSWORD, NULL, 0) ||
        curl_url_get(u, CURLUPART_URL, &text, 0) || !text || strlen(text) >= bytes)
        status = fail(ERR_INPUT, "'%s' is no address below %s", what, of);
    else if (!is_web(text) || !same_server(base, text))
        status = fail(ERR_INPUT, "'%s' is not on the server of %s (scheme, host and port)", what, of);
    else
        strcpy(out, text);
    curl_free(text);
    curl_url_cleanup(u);
    return status;
}

static enum status transfer_error(CURLcode code, const struct transfer *transfer, const char *address,
                                  const char *detail)
{
    char url[ADDRESS_SHOWN_BYTES];
    address_shown(address, url);
    if (transfer->too_large || code == CURLE_FILESIZE_EXCEEDED)
        return fail(ERR_INPUT, "%s is larger than %zu bytes", url, transfer->most);
    if (transfer->no_memory || code == CURLE_OUT_OF_MEMORY)
        return fail(ERR_MEMORY, "no memory to read %s", url);
    switch (code) {
    case CURLE_OPERATION_TIMEDOUT: return fail(ERR_IO, "%s does not answer in time", url);
    case CURLE_COULDNT_RESOLVE_HOST: return fail(ERR_IO, "%s: the host is not known; is the network there?", url);
    case CURLE_COULDNT_CONNECT: return fail(ERR_IO, "%s: nothing answers there", url);
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
        return fail(ERR_IO, "%s: its certificate is not trusted (%s)", url,
                    detail[0] ? detail : curl_easy_strerror(code));
    default: return fail(ERR_IO, "%s cannot be read (%s)", url, detail[0] ? detail : curl_easy_strerror(code));
    }
}

static void set_limits(CURL *c, const struct http_limits *limits)
{
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)limits->connect_ms);
    curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, (long)limits->total_ms);
    curl_easy_setopt(c, CURLOPT_MAXFILESIZE_LARGE, (curl_off_t)limits->most_bytes);
    curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(c, CURLOPT_FOLLOWLOCATION, 0L);
    curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L);
    if (limits->authorities)
        curl_easy_setopt(c, CURLOPT_CAINFO, limits->authorities);
}

// One request without redirects. *next: where the server redirects to, "" for nowhere. On a copy of the handle: libcurl
// 7.88 appends an answer's header that begins with white space to the last one of the handle's answer before, which is
// freed.
static enum status send_request(CURL *given, const char *url, const struct http_limits *limits,
                                struct transfer *transfer, long *code, char next[ADDRESS_MAX])
{
    char detail[CURL_ERROR_SIZE] = "";
    char *redirect = NULL;
    CURL *c = curl_easy_duphandle(given);
    if (!c)
        return fail(ERR_MEMORY, "no memory to read %s", address_shown(url, detail));
    free(transfer->answer->body);
    *transfer->answer = (struct http_answer){0};
    transfer->capacity = 0;
    set_limits(c, limits);
    curl_easy_setopt(c, CURLOPT_URL, url);
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, detail);
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, transfer);
    curl_easy_setopt(c, CURLOPT_HEADERFUNCTION, take_header);
    curl_easy_setopt(c, CURLOPT_HEADERDATA, transfer);
    const CURLcode result = curl_easy_perform(c);
    enum status status = result == CURLE_OK ? OK : transfer_error(result, transfer, url, detail);
    next[0] = 0;
    curl_easy_getinfo(c, CURLINFO_RESPONSE_CODE, code);
    curl_easy_getinfo(c, CURLINFO_REDIRECT_URL, &redirect);
    if (status == OK && redirect && snprintf(next, ADDRESS_MAX, "%s", redirect) >= ADDRESS_MAX)
        status = fail(ERR_INPUT, "%s redirects to an address that is too long", address_shown(url, detail));
    curl_easy_cleanup(c);
    return status;
}

static enum status server_error(long code, const char *url)
{
    switch (code) {
    case 401: return fail(ERR_IO, "%s: the server asks for a name and password that are right", url);
    case 404:
    case 410: return fail(ERR_MISSING, "%s: the server has nothing there", url);
    default: return fail(ERR_IO, "%s: the server answers with error %ld", url, code);
    }
}

enum { MAX_REDIRECTS = 3 }; // within the server

static enum status follow_redirects(CURL *c, const char *url, const struct http_limits *limits,
                                    struct transfer *transfer)
{
    char at[ADDRESS_MAX], next[ADDRESS_MAX], shown[ADDRESS_SHOWN_BYTES];
    long code = 0;
    address_shown(url, shown);
    if ((size_t)snprintf(at, sizeof at, "%s", url) >= sizeof at)
        return fail(ERR_INPUT, "the address %s is too long", shown);
    address_hide_user(at);
    for (int i = 0; i <= MAX_REDIRECTS; i++) {
        enum status status = send_request(c, at, limits, transfer, &code, next);
        if (status != OK)
            return status;
        if (!next[0])
            break;
        address_hide_user(next);
        if (!is_web(next) || !same_server(at, next))
            return fail(ERR_INPUT, "%s redirects to another server (scheme, host or port)", shown);
        if (i == MAX_REDIRECTS)
            return fail(ERR_INPUT, "%s redirects more than %d times", shown, MAX_REDIRECTS);
        snprintf(at, sizeof at, "%s", next);
    }
    transfer->answer->unchanged = code == 304;
    return code == 200 || code == 304 ? OK : server_error(code, shown);
}

// Name and password of an address on the same server.
static void log_in(CURL *c, const char *url, const char *login)
{
    char user[256], password[256];
    if (!same_server(url, login))
        return;
    url_part(login, CURLUPART_USER, user, sizeof user);
    url_part(login, CURLUPART_PASSWORD, password, sizeof password);
    if (user[0] || password[0]) {
        curl_easy_setopt(c, CURLOPT_USERNAME, user);
        curl_easy_setopt(c, CURLOPT_PASSWORD, password);
    }
}

enum status http_get(const char *url, const char *etag, const struct http_limits *limits, struct http_answer *out)
{
    pthread_once(&once, start_curl);
    *out = (struct http_answer){0};
    char shown[ADDRESS_SHOWN_BYTES];
    address_shown(url, shown);
    if (!is_web(url))
        return fail(ERR_INPUT, "'%s' is no http or https address", shown);
    struct transfer t = {.answer = out, .most = limits->most_bytes};
    CURL *c = curl_easy_init();
    struct curl_slist *headers =
        curl_slist_append(NULL, "Accept: application/ld+json, application/json;q=0.9, */*;q=0.1");
    char line[192];
    if (headers && etag && etag[0]) {
        snprintf(line, sizeof line, "If-None-Match: %s", etag);
        struct curl_slist *more = curl_slist_append(headers, line);
        headers = more ? more : headers;
    }
    enum status status = c && headers ? OK : fail(ERR_MEMORY, "no memory to read %s", shown);
    if (status == OK) {
        log_in(c, url, limits->login ? limits->login : url);
        curl_easy_setopt(c, CURLOPT_HTTPHEADER, headers);
        status = follow_redirects(c, url, limits, &t);
    }
    if (c)
        curl_easy_cleanup(c);
    curl_slist_free_all(headers);
    if (status != OK) {
        free(out->body);
        *out = (struct http_answer){0};
    }
    return status;
}

#else

bool http_available(void) { return false; }

enum status http_get(const char *url, const char *etag, const struct http_limits *limits, struct http_answer *out)
{
    (void)etag;
    (void)limits;
    char shown[ADDRESS_SHOWN_BYTES];
    *out = (struct http_answer){0};
    return fail(ERR_IO, "%s: this program was built without libcurl", address_shown(url, shown));
}

enum status http_resolve(const char *base, const char *reference, char *out, size_t bytes)
{
    (void)out;
    (void)bytes;
    char of[ADDRESS_SHOWN_BYTES], what[ADDRESS_SHOWN_BYTES];
    return fail(ERR_INPUT, "'%s' below %s: this program was built without libcurl", address_shown(reference, what),
                address_shown(base, of));
}

#endif
