// Any bytes as what a server answers: headers, bodies, redirects. A line "----" parts the answers to requests that
// follow one another, as after a redirect. The server is a thread of this process, on a loopback address.
#include "platform/network/http_client.h"
#include "tests/fuzz/fuzz.h"

#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { MAX_BYTES = 4096, PATIENCE_MS = 200 };

static struct {
    pthread_mutex_t lock;
    int listener, port;
    const uint8_t *data; // what is left to answer with
    size_t size;
} server = {.lock = PTHREAD_MUTEX_INITIALIZER};

// A copy of the next answer's bytes, up to the line that parts it from the one after: the client may have given up, and
// the input be gone, before all is sent. The caller frees it.
static size_t next_answer(uint8_t **out)
{
    static const char part[] = "\n----\n";
    pthread_mutex_lock(&server.lock);
    const uint8_t *end = server.size ? memmem(server.data, server.size, part, sizeof part - 1) : NULL;
    const size_t count = end ? (size_t)(end - server.data) : server.size;
    const size_t taken = end ? count + sizeof part - 1 : count;
    *out = malloc(count + 1);
    FUZZ_CHECK(*out);
    if (count)
        memcpy(*out, server.data, count);
    server.data += taken;
    server.size -= taken;
    pthread_mutex_unlock(&server.lock);
    return count;
}

static void answer(int connection)
{
    char request[2048];
    size_t have = 0;
    struct pollfd ready = {connection, POLLIN, 0};
    while (have < sizeof request && poll(&ready, 1, PATIENCE_MS) > 0) {
        const ssize_t got = recv(connection, request + have, sizeof request - have, 0);
        if (got <= 0)
            break;
        have += (size_t)got;
        if (memmem(request, have, "\r\n\r\n", 4))
            break;
    }
    uint8_t *bytes;
    const size_t count = next_answer(&bytes);
    for (size_t done = 0; done < count;) {
        const ssize_t sent = send(connection, bytes + done, count - done, MSG_NOSIGNAL);
        if (sent <= 0)
            break;
        done += (size_t)sent;
    }
    free(bytes);
    shutdown(connection, SHUT_WR);
    while (poll(&ready, 1, PATIENCE_MS) > 0 && recv(connection, request, sizeof request, 0) > 0)
        ;
    close(connection);
}

static void *serve(void *nothing)
{
    for (int connection; (connection = accept(server.listener, NULL, NULL)) >= 0;)
        answer(connection);
    return nothing;
}

static void start(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t bytes = sizeof at;
    pthread_t thread;
    server.listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    FUZZ_CHECK(server.listener >= 0 && !bind(server.listener, (struct sockaddr *)&at, bytes));
    FUZZ_CHECK(!listen(server.listener, 8) && !getsockname(server.listener, (struct sockaddr *)&at, &bytes));
    server.port = ntohs(at.sin_port);
    FUZZ_CHECK(!pthread_create(&thread, NULL, serve, NULL));
    pthread_detach(thread);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (!http_available())
        return 0;
    if (!server.port)
        start();
    pthread_mutex_lock(&server.lock);
    server.data = data;
    server.size = size;
    pthread_mutex_unlock(&server.lock);
    char url[64];
    snprintf(url, sizeof url, "http://127.0.0.1:%d/things/mug", server.port);
    struct http_limits limits = http_default_limits();
    limits.total_ms = PATIENCE_MS;
    limits.most_bytes = MAX_BYTES;
    struct http_answer got;
    const enum status status = fuzz_said(http_get(url, "\"before\"", &limits, &got));
    FUZZ_CHECK(strnlen(got.etag, sizeof got.etag) < sizeof got.etag);
    FUZZ_CHECK(status == OK || (!got.body && !got.count));
    FUZZ_CHECK(got.count <= MAX_BYTES && (!got.body || !got.body[got.count]));
    free(got.body);
    pthread_mutex_lock(&server.lock); // the data is the caller's again
    server.data = NULL;
    server.size = 0;
    pthread_mutex_unlock(&server.lock);
    return 0;
}
