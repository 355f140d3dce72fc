// What is newer is asked for on a thread: the app waits for no server that is absent or silent, and what was kept
// stays.
#include "app/place/place_things.h"
#include "base/clock.h"
#include "tests/support/test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <netinet/in.h>
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

static struct knowledge_asker *start(int total_ms)
{
    struct knowledge_asker *a;
    struct knowledge_asker_options how = {.limits = http_default_limits()};
    how.limits.connect_ms = how.limits.total_ms = total_ms;
    EXPECT_STATUS(knowledge_asker_start(&a, &how), OK);
    return a;
}

static void test_an_absent_server_costs_nothing(void **state)
{
    (void)state;
    struct place_thing thing = kept_thing("http://127.0.0.1:9/things/dumbbell");
    struct place_things things = {&thing, 1};
    struct knowledge_asker *a = start(2000);
    EXPECT_INT(knowledge_asker_take(a, &things), -1);
    knowledge_asker_ask(a, 0, &thing);
    int taken = -1;
    for (int64_t until = clock_now_ns() + 20000000000; taken < 0 && clock_now_ns() < until;) {
        taken = knowledge_asker_take(a, &things);
        clock_sleep_until_ns(clock_now_ns() + 2000000);
    }
    EXPECT_INT(taken, 0);
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
    struct knowledge_asker *a = start(3000);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_absent_server_costs_nothing),
        cmocka_unit_test(test_a_silent_server_is_not_waited_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
