/* Latencies as orchestrator/system/latency_and_loss.py draws them, with whole numbers throughout. */

#include "program.h"

/* A uniform number from 0 to 1, times 2^53 (O'Neill, PCG, HMC-CS-2014-0905: XSL RR 128/64; numpy's
 * Generator.random). */
static uint64_t draw(Pcg64 *g) {
    const __uint128_t multiplier = (__uint128_t)2549297995355413924u << 64 | 4865540595714422341u;
    const __uint128_t before = (__uint128_t)g->state[0] << 64 | g->state[1];
    const __uint128_t increment = (__uint128_t)g->increment[0] << 64 | g->increment[1];
    const __uint128_t state = before * multiplier + increment;
    g->state[0] = (uint64_t)(state >> 64);
    g->state[1] = (uint64_t)state;
    const uint64_t folded = g->state[0] ^ g->state[1], turn = g->state[0] >> 58;
    return (folded >> turn | folded << (-turn & 63)) >> 11;
}

int64_t latency_draw(const Latency *latency, Pcg64 *generator) {
    const uint64_t share = draw(generator), luck = draw(generator);
    if ((double)luck * 0x1p-53 < latency->loss) return -1;
    /* ceil(N / (unit 2^53)), N = low 2^53 + spread share. A division of 128 bits would call a
     * function of the compiler's library. */
    const __uint128_t product = (__uint128_t)latency->spread * share;
    const uint64_t whole = latency->low + (uint64_t)(product >> 53);
    const uint64_t rest = (uint64_t)product & ((1ull << 53) - 1);
    return (int64_t)(whole / latency->unit + (whole % latency->unit || rest));
}

double uniform(Pcg64 *generator) { return (double)draw(generator) * 0x1p-53; }
