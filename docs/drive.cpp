// Steps virtual_mechanism for 3 s under 0.5 N and prints where the operational point ends.
#include "fmi2Functions.h"

#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <fstream>
#include <iterator>
#include <regex>
#include <stdexcept>
#include <string>

static void log(fmi2ComponentEnvironment, fmi2String name, fmi2Status, fmi2String, fmi2String text, ...) {
    va_list arguments;
    va_start(arguments, text);
    std::fprintf(stderr, "%s: ", name);
    std::vfprintf(stderr, text, arguments);
    va_end(arguments);
}

static void check(fmi2Status status, const char *call) {
    if (status > fmi2Warning) throw std::runtime_error(call);
}

int main() {
    std::ifstream file("mechanism/modelDescription.xml");
    const std::string xml(std::istreambuf_iterator<char>(file), {});
    auto find = [&](const std::string &pattern) {
        std::smatch found;
        if (!std::regex_search(xml, found, std::regex(pattern))) throw std::runtime_error(pattern);
        return found[1].str();
    };
    auto reference = [&](const std::string &name) {
        return fmi2ValueReference(std::stoul(find("name=\"" + name + "\" valueReference=\"(\\d+)\"")));
    };
    void *library = dlopen("mechanism/binaries/linux64/virtual_mechanism.so", RTLD_NOW);
    if (!library) throw std::runtime_error(dlerror());
#define FMI(name) auto *name = reinterpret_cast<name##TYPE *>(dlsym(library, #name))
    FMI(fmi2Instantiate);
    FMI(fmi2SetupExperiment);
    FMI(fmi2EnterInitializationMode);
    FMI(fmi2ExitInitializationMode);
    FMI(fmi2SetReal);
    FMI(fmi2GetReal);
    FMI(fmi2DoStep);
    FMI(fmi2Terminate);
    FMI(fmi2FreeInstance);

    const fmi2CallbackFunctions callbacks{log, std::calloc, std::free, nullptr, nullptr};
    const std::string guid = find("guid=\"([^\"]+)\"");
    fmi2Component fmu =
        fmi2Instantiate("mechanism", fmi2CoSimulation, guid.c_str(), "", &callbacks, fmi2False, fmi2False);
    if (!fmu) throw std::runtime_error("fmi2Instantiate");
    const fmi2ValueReference force = reference("F_hand\\[1\\]");
    const fmi2ValueReference pose[] = {reference("x\\[1\\]"), reference("x\\[2\\]"), reference("x\\[3\\]")};
    const fmi2Real newton = 0.5, h = 1.0 / 512;
    fmi2Real x[3];
    check(fmi2SetupExperiment(fmu, fmi2False, 0, 0, fmi2False, 0), "fmi2SetupExperiment");
    check(fmi2EnterInitializationMode(fmu), "fmi2EnterInitializationMode");
    check(fmi2SetReal(fmu, &force, 1, &newton), "fmi2SetReal");
    check(fmi2ExitInitializationMode(fmu), "fmi2ExitInitializationMode");
    for (int k = 0; k < 3 * 512; ++k) check(fmi2DoStep(fmu, k * h, h, fmi2True), "fmi2DoStep");
    check(fmi2GetReal(fmu, pose, 3, x), "fmi2GetReal");
    std::printf("%.17g %.17g %.17g\n", x[0], x[1], x[2]);
    check(fmi2Terminate(fmu), "fmi2Terminate");
    fmi2FreeInstance(fmu);
}
