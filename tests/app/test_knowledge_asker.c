// What is newer is asked for on a thread: the app waits for no server that is absent or silent, and what was kept
// stays.
#include "tests/support/test.h"

#include "app/place/place_things.h"
#include "base/clock.h"
#include "recording/recorded_things.h"
#include "tests/support/scratch.h"

#include <netinet/in.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// A server that accepts and says nothing. Returns its socket; *port: where.
static int silent_server(int *port)
{
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t size = sizeof a;
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    EXPECT_TRUE(s >= 0 && bind(s, (struct sockaddr *)&a, sizeof a) == 0 && listen(s, 4) == 0);
    EXPECT_TRUE(getsockname(s, (struct sockaddr *)&a, &size) == 0);
    *port = ntohs(a.sin_port);
    return s;
}

static struct place_thing kept_thing(const char *url)
{
    struct place_thing t = {.known = true};
    snprintf(t.name, sizeof t.name, "dumbbell");
    snprintf(t.knowledge.name, sizeof t.knowledge.name, "Dumbbell");
    snprintf(t.url, sizeof t.url, "%s", url);
    return t;
}

static struct knowledge_asker *start(const char *file, int total_ms)
{
    struct knowledge_asker *a;
    struct knowledge_asker_options options = {.file = file, .limits = http_default_limits()};
    options.limits.connect_ms = options.limits.total_ms = total_ms;
    EXPECT_STATUS(knowledge_asker_start(&a, &options), OK);
    return a;
}

static void await_answer(struct knowledge_asker *a, struct place_things *things)
{
    int taken = -1;
    for (int64_t until = clock_now_ns() + 20000000000; taken < 0 && clock_now_ns() < until;) {
        taken = knowledge_asker_take(a, things);
        clock_sleep_until_ns(clock_now_ns() + 2000000);
    }
    EXPECT_INT(taken, 0);
}

static void test_an_absent_server_costs_nothing(void **state)
{
    (void)state;
    struct place_thing thing = kept_thing("http://127.0.0.1:9/things/dumbbell");
    struct place_things things = {&thing, 1};
    struct knowledge_asker *a = start(NULL, 2000);
    EXPECT_INT(knowledge_asker_take(a, &things), -1);
    knowledge_asker_ask(a, 0, &thing);
    await_answer(a, &things);
    print_message("trouble: %s\n", thing.trouble);
    EXPECT_TRUE(thing.trouble[0] && thing.known);
    assert_string_equal(thing.knowledge.name, "Dumbbell");
    EXPECT_TRUE(!knowledge_asker_asks(a, 0));
    knowledge_asker_close(&a);
    EXPECT_TRUE(!a);
}

// Asking, taking and closing go on while the server keeps its answer to itself; the time is the thread's.
static void test_a_silent_server_is_not_waited_for(void **state)
{
    (void)state;
    char url[64];
    int port;
    const int server = silent_server(&port);
    snprintf(url, sizeof url, "http://127.0.0.1:%d/x", port);
    struct place_thing thing = kept_thing(url);
    struct place_things things = {&thing, 1};
    struct knowledge_asker *a = start(NULL, 3000);
    knowledge_asker_ask(a, 0, &thing);
    EXPECT_TRUE(knowledge_asker_asks(a, 0));
    int answers = 0;
    for (int i = 0; i < 50; i++)
        answers += knowledge_asker_take(a, &things) >= 0;
    EXPECT_INT(answers, 0);
    clock_sleep_until_ns(clock_now_ns() + 100000000); // the request runs
    const int64_t before = clock_now_ns();
    knowledge_asker_close(&a);
    print_message("closed in %.1f ms\n", (double)(clock_now_ns() - before) * 1e-6);
    EXPECT_TRUE(!thing.trouble[0] && thing.known);
    close(server); // the thread's request ends with it
    clock_sleep_until_ns(clock_now_ns() + 300000000);
}

// ---------------------------------------------------------------- kept in the recording

// Answers any request for a picture with bytes, any other with what is known; until its socket is shut down.
struct talking_server {
    int socket, port, weight_kg;
    pthread_t thread;
};

static void *serve(void *self)
{
    struct talking_server *s = self;
    for (int c; (c = accept(s->socket, NULL, NULL)) >= 0; close(c)) {
        char request[2048], body[512], answer[1024];
        const ssize_t count = read(c, request, sizeof request - 1);
        request[count > 0 ? count : 0] = 0;
        if (strstr(request, "GET /picture"))
            snprintf(body, sizeof body, "not quite a picture");
        else
            snprintf(body, sizeof body,
                     "{\"@type\": \"Product\", \"name\": \"Dumbbell\", \"weight\": \"%d kg\", \"image\": "
                     "\"/picture.png\"}",
                     s->weight_kg);
        snprintf(answer, sizeof answer,
                 "HTTP/1.1 200 OK\r\nETag: \"%d\"\r\nContent-Length: %zu\r\n"
                 "Connection: close\r\n\r\n%s",
                 s->weight_kg, strlen(body), body);
        if (write(c, answer, strlen(answer)) < 0)
            continue;
    }
    return NULL;
}

static void start_server(struct talking_server *s)
{
    *s = (struct talking_server){.weight_kg = 3};
    s->socket = silent_server(&s->port);
    EXPECT_INT(pthread_create(&s->thread, NULL, serve, s), 0);
}

static void stop_server(struct talking_server *s)
{
    shutdown(s->socket, SHUT_RDWR);
    EXPECT_INT(pthread_join(s->thread, NULL), 0);
    close(s->socket);
}

static void record_thing(const char *file, int port)
{
    struct recording_writer *writer;
    struct recorded_thing t = {.world_from_thing = {{0, 0, 0, 1}, {1, 2, 0.5}}, .width_m = 0.3, .height_m = 0.1};
    snprintf(t.name, sizeof t.name, "dumbbell");
    snprintf(t.note, sizeof t.note, "by hand");
    snprintf(t.url, sizeof t.url, "http://127.0.0.1:%d/dumbbell", port);
    EXPECT_STATUS(recording_create(&writer, file), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    EXPECT_STATUS(recording_write_things(file, &t, 1), OK);
}

// The weight that the file gives the thing, or 0; the rest is as it was recorded.
static int recorded_weight_kg(const char *file)
{
    struct recording *r;
    struct recorded_thing *t;
    int count, weight = 0;
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(recording_read_things(r, &t, &count), OK);
    recording_free(&r);
    EXPECT_INT(count, 1);
    assert_string_equal(t->note, "by hand");
    EXPECT_NEAR(t->world_from_thing.translation.y, 2, 0);
    if (t->knowledge) {
        const char *kg = strstr(t->knowledge, "\"weight\": \"");
        EXPECT_TRUE(kg != NULL);
        weight = atoi(kg + strlen("\"weight\": \""));
        EXPECT_TRUE(t->image.bytes && !memcmp(t->image.bytes, "not quite a picture", t->image.count));
        EXPECT_TRUE(t->etag[0] != 0);
    }
    recorded_things_free(&t, count);
    return weight;
}

static void test_answers_are_kept_where_the_file_can_be_written(void **state)
{
    (void)state;
    struct talking_server server;
    struct scratch scratch = scratch_make();
    char file[256];
    struct recording *watched; // as the app has it open
    struct recording_writer *writer;
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "things.reenact"));
    if (!http_available())
        skip_without("libcurl");
    start_server(&server);
    record_thing(file, server.port);
    EXPECT_INT(recorded_weight_kg(file), 0);
    EXPECT_STATUS(recording_open(&watched, file), OK);
    struct place_things things;
    EXPECT_STATUS(place_things_read(watched, &things), OK);
    struct knowledge_asker *a = start(file, 5000);
    knowledge_asker_ask(a, 0, &things.things[0]);
    await_answer(a, &things);
    EXPECT_TRUE(things.things[0].known && !things.things[0].unkept && !things.things[0].trouble[0]);
    EXPECT_INT(recorded_weight_kg(file), 3);
    // While another program writes the file it is left alone; what came is shown.
    server.weight_kg = 4;
    EXPECT_STATUS(recording_append(&writer, file), OK);
    knowledge_asker_ask(a, 0, &things.things[0]);
    await_answer(a, &things);
    EXPECT_STATUS(recording_close(&writer), OK);
    assert_string_equal(things.things[0].knowledge.weight, "4 kg");
    EXPECT_TRUE(things.things[0].unkept);
    EXPECT_INT(recorded_weight_kg(file), 3);
    knowledge_asker_close(&a);
    place_things_free(&things);
    recording_free(&watched);
    stop_server(&server);
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_absent_server_costs_nothing),
        cmocka_unit_test(test_a_silent_server_is_not_waited_for),
        cmocka_unit_test(test_answers_are_kept_where_the_file_can_be_written),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
