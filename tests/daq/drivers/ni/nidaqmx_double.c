/* A double of NI's C library: one card whose code number i of channel c is 7 i + 1000 c, wrapped to 16 bits. The third
 * read of a task is late (half its samples, then the time-out) and the fifth reports overwritten samples. A restarted
 * task has neither fault, nor has any task if NIDAQMX_DOUBLE_FAULTLESS is in the environment. With NIDAQMX_DOUBLE_WARNS,
 * setting the clock and the first two reads give a warning. There is an edge every 250 samples; a counter that is armed
 * before the samples start latches the ticks since their start, in 32 bits. `alive` counts the tasks that have not been
 * cleared. */
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    int channels, started, reads;
    uint64_t position;
    uint32_t buffer;
    double rate;
    int counts, armed; /* of a counter: number of settings made, and whether it waits for the samples */
} Task;

enum { EDGE_EVERY = 250 };
static Task task, counter;
static Task *made; /* the latest task; its channels determine its kind */
int alive;
static const double scaling[4] = {6e-4, 3.2e-4, 1.4e-13, -7.1e-18};

static int text(va_list arguments, const char *value) {
    char *out = va_arg(arguments, char *);
    uint32_t size = va_arg(arguments, uint32_t);
    if (size == 0) return (int)strlen(value) + 1; /* the first call requests the length */
    strncpy(out, value, size);
    return 0;
}

#define WITH_ARGUMENTS(last, statement) \
    va_list arguments; \
    va_start(arguments, last); \
    int status = 0; \
    statement; \
    va_end(arguments); \
    return status

int DAQmxSetRuntimeEnvironment(const char *a, const char *b, const char *c, const char *d) { return 0; }
int DAQmxGetSystemInfoAttribute(int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, if (attribute == 0x193B) status = text(arguments, "Dev1, Dev2");
                   else *va_arg(arguments, uint32_t *) = attribute == 0x1272 ? 24 : 0);
}
int DAQmxGetDeviceAttribute(const char *device, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, if (attribute == 0x631) status = text(arguments, "USB-6251");
                   else *va_arg(arguments, uint32_t *) = attribute == 0x632 ? 0x1A2B30u + (device[3] - '0') : 0);
}
int DAQmxSelfTestDevice(const char *device) { return 0; }
int DAQmxCreateTask(const char *name, void **handle) {
    made = alive ? &counter : &task; /* the inputs come first */
    memset(made, 0, sizeof *made);
    alive++;
    *handle = made;
    return 0;
}
int DAQmxClearTask(void *handle) { alive--; return 0; }
int DAQmxGetTaskAttribute(void *handle, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, status = text(arguments, "_unnamedTask<0>"));
}
int DAQmxCreateAIVoltageChan(void *handle, const char *physical, const char *name, int terminal, double low, double high,
                             int units, const char *scale) {
    task.channels++;
    return strncmp(physical, "Dev2/ai", 7) || terminal != 10106 || low != -10 || high != 10 ? -200077 : 0;
}
int DAQmxCreateCICountEdgesChan(void *handle, const char *physical, const char *name, int edge, uint32_t initial, int up) {
    return handle != &counter || strcmp(physical, "Dev2/ctr0") || edge != 10280 || initial || up != 10128 ? -200077 : 0;
}
int DAQmxSetChanAttribute(void *handle, const char *channel, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, const char *term = va_arg(arguments, const char *);
                   if (attribute != 0x18C7 || strcmp(term, "/Dev2/80MHzTimebase")) status = -89136; else counter.counts++);
}
#ifndef OLD /* a library of before there was this function */
int DAQmxSetTrigAttribute(void *handle, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, if (attribute == 0x1417) {
        if (strcmp(va_arg(arguments, const char *), "/Dev2/ai/StartTrigger")) status = -89120;
    } else if (va_arg(arguments, int32_t) != (attribute == 0x1414 ? 10150 : 10280)) status = -200077;
    counter.counts += status == 0);
}
#endif
int DAQmxCfgSampClkTiming(void *handle, const char *source, double rate, int edge, int mode, uint64_t samples) {
    if (handle == &counter) {
        counter.counts++;
        return mode != 10123 || edge != 10280 ? -200077 : strcmp(source, "/Dev2/PFI0") ? -89120 : 0;
    }
    task.rate = rate;
    return mode != 10123 ? -200077 : getenv("NIDAQMX_DOUBLE_WARNS") ? 200011 : 0;
}
int DAQmxSetBufferAttribute(void *handle, int32_t attribute, uint32_t value) {
    if (handle == &task) task.buffer = value;
    return attribute == 0x186C ? 0 : -200077;
}
int DAQmxGetBufferAttribute(void *handle, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, *va_arg(arguments, uint32_t *) = attribute == 0x186C ? task.buffer : 0);
}
int DAQmxTaskControl(void *handle, int action) { return 0; }
int DAQmxGetTimingAttribute(void *handle, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, *va_arg(arguments, double *) = attribute == 0x1344 ? task.rate + 0.25 : 90000.0);
}
int DAQmxGetChanAttribute(void *handle, const char *channel, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, double *out = va_arg(arguments, double *); if (attribute != 0x1930) *out = attribute == 0x1815 ? 10 : -10;
                   else if (va_arg(arguments, uint32_t) == 0) status = 4; else memcpy(out, scaling, sizeof scaling));
}
int DAQmxStartTask(void *handle) {
    if (handle == &counter) {
        counter.armed = counter.counts == 5; /* clock, line, and what begins it */
        counter.started = 0;
        counter.position = 0;
        return 0;
    }
    counter.started = counter.armed;
    task.started++;
    task.reads = 0;
    task.position = 0;
    return 0;
}
int DAQmxStopTask(void *handle) {
    return handle == &task && task.reads == 5 && !getenv("NIDAQMX_DOUBLE_FAULTLESS") ? -200279 : 0;
}
int DAQmxReadBinaryI16(void *handle, int n, double timeout, int fill, int16_t *out, uint32_t size, int *read, void *none) {
    *read = 0;
    task.reads++;
    int scripted = task.started == 1 && !getenv("NIDAQMX_DOUBLE_FAULTLESS");
    if (scripted && task.reads == 5) return -200279;
    *read = scripted && task.reads == 3 ? n / 2 : n;
    for (int c = 0; c < task.channels; c++)
        for (int i = 0; i < *read; i++) out[c * *read + i] = (int16_t)(7 * (task.position + i) + 1000 * c);
    task.position += *read;
    return *read < n ? -200284 : task.reads < 3 && getenv("NIDAQMX_DOUBLE_WARNS") ? 200060 : 0;
}
int DAQmxReadCounterU32Ex(void *handle, int n, double timeout, int fill, uint32_t *out, uint32_t size, int *read, void *none) {
    double ticks = 80e6 / (task.rate + 0.25) * EDGE_EVERY;
    *read = 0;
    if (handle != &counter || timeout != 0) return -200077;
    for (; counter.started && *read < n && (counter.position + 1) * EDGE_EVERY < task.position; counter.position++)
        out[(*read)++] = (uint32_t)((uint64_t)((counter.position + 1) * ticks));
    return *read < n ? -200284 : 0;
}
int DAQmxGetReadAttribute(void *handle, int32_t attribute, ...) {
    WITH_ARGUMENTS(attribute, if (attribute == 0x1223) *va_arg(arguments, uint32_t *) = 42;
                   else *va_arg(arguments, uint64_t *) = task.position + (attribute == 0x192A ? 5000 : 0));
}
int DAQmxGetErrorString(int32_t code, char *out, uint32_t size) {
    strncpy(out, code == 200011 ? "too fast\nto settle\n\nTask Name: t" : "read twice", size);
    return 0;
}
int DAQmxGetExtendedErrorInfo(char *out, uint32_t size) { strncpy(out, "the library's text", size); return 0; }
