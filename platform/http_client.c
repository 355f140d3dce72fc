#include "platform/http_client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

struct http_limits http_default_limits(void) { return (struct http_limits){3000, 10000, 4 << 20, 3, NULL}; }

#ifdef HAVE_CURL

#include <curl/curl.h>
#include <pthread.h>

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

// The part of an address, "" if there is none.
static void url_part(const char *url, CURLUPart part, char *out, size_t bytes)
{
    CURLU *u = curl_url();
    char *text = NULL;
    out[0] = 0;
    if (u && !curl_url_set(u, CURLUPART_URL, url, 0) && !curl_url_get(u, part, &text, 0) && text)
        snprintf(out, bytes, "%s", text);
    curl_free(text);
    curl_url_cleanup(u);
}

static bool same_host(const char *a, const char *b)
{
    char host[2][256], scheme[2][16];
    url_part(a, CURLUPART_HOST, host[0], sizeof host[0]);
    url_part(b, CURLUPART_HOST, host[1], sizeof host[1]);
    url_part(a, CURLUPART_SCHEME, scheme[0], sizeof scheme[0]);
    url_part(b, CURLUPART_SCHEME, scheme[1], sizeof scheme[1]);
    const bool weaker = !strcmp(scheme[0], "https") && strcmp(scheme[1], "https");
    return host[0][0] && !strcasecmp(host[0], host[1]) && !weaker;
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
    CURLU *u = curl_url();
    char *text = NULL;
    enum status status = OK;
    if (!u || curl_url_set(u, CURLUPART_URL, base, 0) || curl_url_set(u, CURLUPART_URL, reference, 0) ||
        curl_url_get(u, CURLUPART_URL, &text, 0) || !text || strlen(text) >= bytes)
        status = fail(ERR_INPUT, "'%.200s' is no address below %.200s", reference, base);
    else if (!is_web(text) || !same_host(base, text))
        status = fail(ERR_INPUT, "'%.200s' is not on the host of %.200s", reference, base);
    else
        strcpy(out, text);
    curl_free(text);
    curl_url_cleanup(u);
    return status;
}

static enum status transfer_error(CURLcode code, const struct transfer *t, const char *url, const char *detail)
{
    if (t->too_large || code == CURLE_FILESIZE_EXCEEDED)
        return fail(ERR_INPUT, "%s is larger than %zu bytes", url, t->most);
    if (t->no_memory || code == CURLE_OUT_OF_MEMORY)
        return fail(ERR_MEMORY, "no memory to read %s", url);
    switch (code) {
    case CURLE_OPERATION_TIMEDOUT: return fail(ERR_IO, "%s does not answer in time", url);
    case CURLE_COULDNT_RESOLVE_HOST: return fail(ERR_IO, "%s: the host is not known; is the network there?", url);
    case CURLE_COULDNT_CONNECT: return fail(ERR_IO, "%s: nothing answers there", url);
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
        return fail(ERR_IO, "%s: its certificate is not trusted (%s)", url,
                    detail[0] ? detail : curl_easy_strerror(code));
    default: return fail(ERR_IO, "%s: %s", url, detail[0] ? detail : curl_easy_strerror(code));
    }
}

static void set_limits(CURL *c, const struct http_limits *l)
{
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)l->connect_ms);
    curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, (long)l->total_ms);
    curl_easy_setopt(c, CURLOPT_MAXFILESIZE_LARGE, (curl_off_t)l->most_bytes);
    curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(c, CURLOPT_FOLLOWLOCATION, 0L);
    curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L);
    if (l->authorities)
        curl_easy_setopt(c, CURLOPT_CAINFO, l->authorities);
}

// One request without redirects. *next: where the server redirects to, "" for nowhere.
static enum status request(CURL *c, const char *url, const struct http_limits *limits, struct transfer *t, long *code,
                           char *next, size_t next_bytes)
{
    char detail[CURL_ERROR_SIZE] = "";
    char *redirect = NULL;
    free(t->answer->body);
    *t->answer = (struct http_answer){0};
    t->capacity = 0;
    set_limits(c, limits);
    curl_easy_setopt(c, CURLOPT_URL, url);
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, detail);
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, t);
    curl_easy_setopt(c, CURLOPT_HEADERFUNCTION, take_header);
    curl_easy_setopt(c, CURLOPT_HEADERDATA, t);
    const CURLcode result = curl_easy_perform(c);
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, NULL);
    if (result != CURLE_OK)
        return transfer_error(result, t, url, detail);
    next[0] = 0;
    curl_easy_getinfo(c, CURLINFO_RESPONSE_CODE, code);
    curl_easy_getinfo(c, CURLINFO_REDIRECT_URL, &redirect);
    if (redirect && (size_t)snprintf(next, next_bytes, "%s", redirect) >= next_bytes)
        return fail(ERR_INPUT, "%s redirects to an address that is too long", url);
    return OK;
}

static enum status follow(CURL *c, const char *url, const struct http_limits *limits, struct transfer *t)
{
    char at[2048], next[2048];
    long code = 0;
    snprintf(at, sizeof at, "%s", url);
    for (int i = 0; i <= limits->most_redirects; i++) {
        enum status status = request(c, at, limits, t, &code, next, sizeof next);
        if (status != OK)
            return status;
        if (!next[0])
            break;
        if (!is_web(next) || !same_host(at, next))
            return fail(ERR_INPUT, "%s redirects to another host", url);
        if (i == limits->most_redirects)
            return fail(ERR_INPUT, "%s redirects more than %d times", url, limits->most_redirects);
        snprintf(at, sizeof at, "%s", next);
    }
    t->answer->unchanged = code == 304;
    if (code == 200 || code == 304)
        return OK;
    return code == 404 || code == 410 ? fail(ERR_MISSING, "%s: the server has nothing there", url)
                                      : fail(ERR_IO, "%s: the server answers with error %ld", url, code);
}

enum status http_get(const char *url, const char *etag, const struct http_limits *limits, struct http_answer *out)
{
    pthread_once(&once, start_curl);
    *out = (struct http_answer){0};
    if (!is_web(url))
        return fail(ERR_INPUT, "'%.200s' is no http or https address", url);
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
    enum status status = c && headers ? OK : fail(ERR_MEMORY, "no memory to read %s", url);
    if (status == OK) {
        curl_easy_setopt(c, CURLOPT_HTTPHEADER, headers);
        status = follow(c, url, limits, &t);
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
    *out = (struct http_answer){0};
    return fail(ERR_IO, "%s: this program was built without libcurl", url);
}

enum status http_resolve(const char *base, const char *reference, char *out, size_t bytes)
{
    (void)out;
    (void)bytes;
    return fail(ERR_INPUT, "'%.200s' below %.200s: this program was built without libcurl", reference, base);
}

#endif
