// Reading and writing JSON (cJSON). Errors name the file and the member. A tree
// belongs to one thread at a time.
#pragma once
#include "base/status.h"

struct json; // a value and everything below it

// ---- reading
// ERR_MISSING, ERR_IO, ERR_MEMORY; ERR_INPUT: not JSON, with the line. *out is then NULL.
MUST_CHECK enum status json_read(const char *path, struct json **out);
// The same from memory; `name` is for the sentence.
MUST_CHECK enum status json_parse(const char *text, size_t count, const char *name, struct json **out);
void json_free(struct json **root); // only roots; NULL is fine; sets *root = NULL

const struct json *json_member(const struct json *object, const char *name); // NULL: no such member, or object is NULL
int json_count(const struct json *array);                                    // 0 if it is neither array nor object
const struct json *json_at(const struct json *array, int index);             // or the members of an object, in order
// One after the other, for long ones: json_at walks from the first each time. NULL: no more.
const struct json *json_first(const struct json *array);
const struct json *json_next(const struct json *value);
const char *json_name(const struct json *member); // "" if it has none
bool json_is_object(const struct json *value);
bool json_is_array(const struct json *value);
// False when it is not of that type (a number must be finite); *out is then untouched.
bool json_get_number(const struct json *value, double *out);
bool json_get_bool(const struct json *value, bool *out);
bool json_get_string(const struct json *value, const char **out); // lives as long as the tree

// The finite number `name` of `object`. ERR_INPUT: "PATH: the number 'NAME' is missing".
MUST_CHECK enum status json_need_number(const struct json *object, const char *name, const char *path, double *out);

// ---- writing: the functions that add report no errors; json_print returns NULL if memory ran out in any of them.
// Of strings, '?' stands for bytes that are not UTF-8: names of files need not be.
struct json *json_new_object(void);
void json_add_number(struct json *object, const char *name, double value); // null unless finite
void json_add_bool(struct json *object, const char *name, bool value);
void json_add_string(struct json *object, const char *name, const char *value);
struct json *json_add_object(struct json *object, const char *name); // the new child; name NULL appends to an array
struct json *json_add_array(struct json *object, const char *name);
void json_push_number(struct json *array, double value);
void json_push_string(struct json *array, const char *value);
char *json_print(const struct json *root); // indented, ends with a newline; the caller frees it
