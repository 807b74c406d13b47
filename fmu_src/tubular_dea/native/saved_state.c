/* Saved states: one block of bytes, the same in memory and serialised, so that restoring is exact and checked. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"

/* Layout: mark, the model's identity, the snapshot, and a checksum over all before it. */
#define MARK "FMUstate"
#define HEADER (sizeof MARK - 1 + sizeof MODEL_GUID)
#define BODY (HEADER + sizeof(Snapshot))
#define SIZE (BODY + sizeof(uint64_t))

/* As FNV-1a, by words, each turned so that no bit stays where it is: delay lines make states long. */
static uint64_t checksum(const unsigned char *bytes, size_t n)
{
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < n; i += sizeof hash) {
        uint64_t word = 0;
        memcpy(&word, bytes + i, n - i < sizeof word ? n - i : sizeof word);
        hash ^= word;
        hash = (hash << 29 | hash >> 35) * 1099511628211u;
    }
    return hash;
}

static Status null(Instance *instance, const char *function)
{
    return instance_report(instance, STATUS_ERROR, "%s: expected a state but was given NULL", function);
}

Status state_get(Instance *instance, const char *function, void **state)
{
    if (!state) return null(instance, function);
    if (!*state) *state = malloc(SIZE);
    if (!*state) return instance_report(instance, STATUS_ERROR, "%s: out of memory", function);
    unsigned char *bytes = *state;
    memcpy(bytes, MARK, sizeof MARK - 1);
    memcpy(bytes + sizeof MARK - 1, MODEL_GUID, sizeof MODEL_GUID);
    memcpy(bytes + HEADER, &instance->now, sizeof(Snapshot));
    if (instance->now.mode == INITIALIZATION) { /* states and discretes follow from the rest */
        const size_t discretes = offsetof(Snapshot, p) + (MODEL_NP - MODEL_ND) * sizeof(double);
        memset(bytes + HEADER + offsetof(Snapshot, x), 0, sizeof instance->now.x);
        memset(bytes + HEADER + discretes, 0, MODEL_ND * sizeof(double));
    }
    const uint64_t sum = checksum(bytes, BODY);
    memcpy(bytes + BODY, &sum, sizeof sum);
    return STATUS_OK;
}

static Status check(Instance *instance, const char *function, const unsigned char *bytes)
{
    const int modes = INSTANTIATED | INITIALIZATION | TERMINATED |
                      (instance->interface == CO_SIMULATION ? STEPPING : EVENT | CONTINUOUS_TIME);
    uint64_t sum;
    int32_t mode;
    memcpy(&sum, bytes + BODY, sizeof sum);
    memcpy(&mode, bytes + HEADER + offsetof(Snapshot, mode), sizeof mode);
    if (memcmp(bytes, MARK, sizeof MARK - 1) || memcmp(bytes + sizeof MARK - 1, MODEL_GUID, sizeof MODEL_GUID))
        return instance_report(instance, STATUS_ERROR, "%s: expected a state of %s %s but was given another", function,
                               MODEL_NAME, MODEL_GUID);
    if (sum != checksum(bytes, BODY))
        return instance_report(instance, STATUS_ERROR, "%s: the state's checksum is wrong; it was changed", function);
    if (!(mode & modes))
        return instance_report(instance, STATUS_ERROR,
                               "%s: expected a state of %s but was given one of the other kind", function,
                               instance->interface == CO_SIMULATION ? "a co-simulation" : "a model exchange");
    return STATUS_OK;
}

Status state_set(Instance *instance, const char *function, const void *state)
{
    if (!state) return null(instance, function);
    const Status status = check(instance, function, state);
    if (status != STATUS_OK) return status;
    memcpy(&instance->now, (const unsigned char *)state + HEADER, sizeof instance->now);
    instance->held.asked = instance->held.within = 0;
    instance_forget(instance);
    return STATUS_OK;
}

void state_free(void **state)
{
    if (!state) return;
    free(*state);
    *state = NULL;
}

Status state_size(Instance *instance, const char *function, const void *state, size_t *size)
{
    if (!state || !size) return null(instance, function);
    *size = SIZE;
    return STATUS_OK;
}

Status state_serialize(Instance *instance, const char *function, const void *state, unsigned char *bytes, size_t size)
{
    if (!state || !bytes) return null(instance, function);
    if (size < SIZE)
        return instance_report(instance, STATUS_ERROR, "%s: expected room for %zu bytes but was given %zu", function, SIZE,
                               size);
    memcpy(bytes, state, SIZE);
    return STATUS_OK;
}

Status state_deserialize(Instance *instance, const char *function, const unsigned char *bytes, size_t size, void **state)
{
    if (!state || !bytes) return null(instance, function);
    if (size != SIZE)
        return instance_report(instance, STATUS_ERROR, "%s: expected %zu bytes but was given %zu", function, SIZE, size);
    const Status status = check(instance, function, bytes);
    if (status != STATUS_OK) return status;
    if (!*state) *state = malloc(SIZE);
    if (!*state) return instance_report(instance, STATUS_ERROR, "%s: out of memory", function);
    memcpy(*state, bytes, SIZE);
    return STATUS_OK;
}
