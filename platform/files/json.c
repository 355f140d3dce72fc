#include "platform/files/json.h"

#include "base/text.h"
#include "platform/files/file.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// `struct json` is never defined: it is cJSON's node under a name that keeps cJSON.h out of json.h.
static cJSON *cjson_node(const struct json *value) { return (cJSON *)(uintptr_t)value; }

static struct json *from_node(cJSON *value) { return (struct json *)value; }

// cJSON says nothing of why it failed; its allocations do.
static _Thread_local bool out_of_memory;

static void *allocate_memory(size_t size)
{
    void *memory = malloc(size);
    out_of_memory |= !memory;
    return memory;
}

static void set_hooks(void)
{
    cJSON_Hooks hooks = {.malloc_fn = allocate_memory, .free_fn = free};
    cJSON_InitHooks(&hooks);
}

enum status json_parse(const char *text, size_t count, const char *name, struct json **out)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, set_hooks);
    out_of_memory = false;
    const char *end = NULL;
    cJSON *root = cJSON_ParseWithLengthOpts(text, count, &end, false);
    *out = from_node(root);
    if (root)
        return OK;
    if (out_of_memory)
        return fail(ERR_MEMORY, "no memory to read %s", name);
    int line = 1;
    for (const char *at = text; end && at < end && *at; at++)
        line += *at == '\n';
    return fail(ERR_INPUT, "%s is not valid JSON near line %d", name, line);
}

enum status json_read(const char *path, struct json **out)
{
    uint8_t *text;
    size_t count;
    *out = NULL;
    enum status status = file_read(path, &text, &count);
    if (status != OK)
        return status;
    status = json_parse((const char *)text, count, path, out);
    free(text);
    return status;
}

void json_free(struct json **root)
{
    cJSON_Delete(cjson_node(*root));
    *root = NULL;
}

const struct json *json_member(const struct json *object, const char *name)
{
    return object ? from_node(cJSON_GetObjectItemCaseSensitive(cjson_node(object), name)) : NULL;
}

int json_count(const struct json *array)
{
    return json_is_array(array) || json_is_object(array) ? cJSON_GetArraySize(cjson_node(array)) : 0;
}

const struct json *json_at(const struct json *array, int index)
{
    return from_node(cJSON_GetArrayItem(cjson_node(array), index));
}

const struct json *json_first(const struct json *array)
{
    return json_is_array(array) || json_is_object(array) ? from_node(cjson_node(array)->child) : NULL;
}

const struct json *json_next(const struct json *value) { return from_node(cjson_node(value)->next); }

const char *json_name(const struct json *member)
{
    const char *name = cjson_node(member)->string;
    return name ? name : "";
}

bool json_is_object(const struct json *value) { return cJSON_IsObject(cjson_node(value)); }

bool json_is_array(const struct json *value) { return cJSON_IsArray(cjson_node(value)); }

bool json_get_number(const struct json *value, double *out)
{
    if (!cJSON_IsNumber(cjson_node(value)) || !isfinite(cjson_node(value)->valuedouble))
        return false;
    *out = cjson_node(value)->valuedouble;
    return true;
}

bool json_get_bool(const struct json *value, bool *out)
{
    if (!cJSON_IsBool(cjson_node(value)))
        return false;
    *out = cJSON_IsTrue(cjson_node(value));
    return true;
}

bool json_get_string(const struct json *value, const char **out)
{
    if (!cJSON_IsString(cjson_node(value)))
        return false;
    *out = cjson_node(value)->valuestring;
    return true;
}

enum status json_need_number(const struct json *object, const char *name, const char *path, double *out)
{
    if (!json_get_number(json_member(object, name), out))
        return fail(ERR_INPUT, "%s: the number '%s' is missing", path, name);
    return OK;
}

struct json *json_new_object(void) { return from_node(cJSON_CreateObject()); }

// What is lost for lack of memory is noted in its parent's number, which objects and arrays do not use.
enum { LOST_A_CHILD = 1 };

static cJSON *attach_child(struct json *parent, const char *name, cJSON *child)
{
    cJSON *to = cjson_node(parent);
    if (child && (name ? cJSON_AddItemToObject(to, name, child) : cJSON_AddItemToArray(to, child)))
        return child;
    cJSON_Delete(child);
    if (to)
        to->valueint = LOST_A_CHILD;
    return NULL;
}

static bool is_whole(const cJSON *value)
{
    bool whole = !(cJSON_IsObject(value) || cJSON_IsArray(value)) || value->valueint != LOST_A_CHILD;
    for (const cJSON *child = value->child; child && whole; child = child->next)
        whole = is_whole(child);
    return whole;
}

void json_add_number(struct json *object, const char *name, double value)
{
    attach_child(object, name, isfinite(value) ? cJSON_CreateNumber(value) : cJSON_CreateNull());
}

void json_add_bool(struct json *object, const char *name, bool value)
{
    attach_child(object, name, cJSON_CreateBool(value));
}

void json_add_string(struct json *object, const char *name, const char *value)
{
    cJSON *string = cJSON_CreateString(value);
    if (string)
        text_make_utf8(string->valuestring);
    attach_child(object, name, string);
}

struct json *json_add_object(struct json *object, const char *name)
{
    return from_node(attach_child(object, name, cJSON_CreateObject()));
}

struct json *json_add_array(struct json *object, const char *name)
{
    return from_node(attach_child(object, name, cJSON_CreateArray()));
}

void json_push_number(struct json *array, double value) { json_add_number(array, NULL, value); }

void json_push_string(struct json *array, const char *value) { json_add_string(array, NULL, value); }

char *json_print(const struct json *root)
{
    char *text = root && is_whole(cjson_node(root)) ? cJSON_Print(cjson_node(root)) : NULL;
    size_t length = text ? strlen(text) : 0;
    char *terminated = text ? realloc(text, length + 2) : NULL; // cJSON allocates with malloc
    if (!terminated) {
        free(text);
        return NULL;
    }
    memcpy(terminated + length, "\n", 2);
    return terminated;
}
