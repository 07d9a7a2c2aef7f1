/* Random numbers as NumPy's PCG64 draws them (O'Neill, PCG, HMC-CS-2014-0905: XSL RR 128/64). */

#include "loop.h"

uint64_t random_bits(Pcg64 *g) { /* Generator.random, times 2^53 */
    const __uint128_t multiplier = (__uint128_t)2549297995355413924u << 64 | 4865540595714422341u;
    const __uint128_t before = (__uint128_t)g->state[0] << 64 | g->state[1];
    const __uint128_t increment = (__uint128_t)g->increment[0] << 64 | g->increment[1];
    const __uint128_t state = before * multiplier + increment;
    g->state[0] = (uint64_t)(state >> 64);
    g->state[1] = (uint64_t)state;
    const uint64_t folded = g->state[0] ^ g->state[1], turn = g->state[0] >> 58;
    return (folded >> turn | folded << (-turn & 63)) >> 11;
}

double uniform(Pcg64 *g) { return (double)random_bits(g) * 0x1p-53; }
