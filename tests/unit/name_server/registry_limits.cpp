// What strangers make the registry hold: each limit by its name, and nobody else pays for it.
#include <ise/name_server/registry.hpp>
#include <ise/packet/schema.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

namespace registry_limits_test {

using namespace std::chrono_literals;
using ise::naming::verdict;
using ise_test::Contains;

namespace {

constexpr ise::time_point start{1h};
const ise::wall_time noon = std::chrono::sys_days(std::chrono::year(2026) / 6 / 1) + 12h;

ise::naming::schema_text text_of(int i, std::size_t bytes = 0) {
    auto name = fmt::format("f{}", i);
    ise::naming::schema_text made;
    made.text = fmt::format("struct{{{}{}:i8}}", name,
                            std::string(bytes > name.size() + 11 ? bytes - name.size() - 11 : 0, 'x'));
    made.fingerprint = ise::schema::parse(made.text).value().fingerprint();
    return made;
}

ise::naming::register_request request_of(std::uint64_t node, const std::string& path, std::uint64_t epoch = 0) {
    ise::naming::register_request request;
    request.node.lease_key = node;
    request.lease = 2s;
    ise::naming::component_claim claim;
    claim.path = path;
    claim.epoch = epoch;
    claim.incarnation = node;
    request.components.push_back(std::move(claim));
    return request;
}

ise::registry_options options(const ise::registry_limits& limits) {
    ise::registry_options made;
    made.recovery = {};
    made.limits = limits;
    return made;
}

} // namespace

TEST_CASE("registry: texts of schemas are bounded by number and by bytes, each by the limit's name") {
    ise::schema_store_limits limits;
    limits.max_schemas = 3;
    limits.max_schema_bytes = 100;
    limits.max_schema_total_bytes = 180;
    ise::schema_store store(limits, ise::secret_hash({1, 2}));
    auto refusal = [&](const ise::naming::schema_text& text) {
        auto kept = store.offer(text);
        return kept ? std::string() : kept.error().message();
    };
    CHECK_THAT(refusal(text_of(0, 101)), Contains("a schema of 101 bytes, max_schema_bytes is 100"));
    CHECK(refusal(text_of(1, 90)).empty());
    CHECK(refusal(text_of(2, 80)).empty());
    CHECK_THAT(refusal(text_of(3)), Contains("max_schema_total_bytes is 180"));
    store.sweep(); // nobody uses them
    for (int i = 4; i < 7; ++i) CHECK(refusal(text_of(i)).empty());
    CHECK_THAT(refusal(text_of(7)), Contains("there are 3 schemas already, which is max_schemas"));
    CHECK(refusal(text_of(5)).empty()); // it is there
}

TEST_CASE("registry: services that name schemas and never show them take no place of those that do") {
    ise::registry_limits limits;
    limits.schemas.max_schemas = 10;
    ise::registry names(options(limits), 1, start, noon);
    auto stranger = request_of(1, "stranger");
    ise::naming::service_entry service;
    service.name = "many";
    for (std::uint64_t fingerprint = 100; fingerprint < 116; ++fingerprint) service.fingerprints.push_back(fingerprint);
    stranger.components[0].services.push_back(service);
    REQUIRE(names.enroll(stranger, start).grants.at(0).what == verdict::granted);
    auto good = request_of(2, "good");
    service.name = "one";
    service.fingerprints = {text_of(1).fingerprint};
    good.components[0].services.push_back(service);
    good.schemas.push_back(text_of(1));
    auto granted = names.enroll(good, start).grants.at(0);
    CHECK(granted.what == verdict::granted);
    CHECK(granted.reason == "");
    auto described = names.describe("good", start);
    REQUIRE(described);
    CHECK(described->schemas.size() == 1);
}

TEST_CASE("registry: a list is told in parts of max_listed, whatever is asked for") {
    ise::registry_limits limits;
    limits.max_listed = 3;
    ise::registry names(options(limits), 1, start, noon);
    for (int i = 0; i < 5; ++i) names.enroll(request_of(1, fmt::format("c{}", i)), start);
    ise::naming::list_request request;
    request.limit = GENERATE(0u, 4u, 0xffff'ffffu);
    auto part = names.list(request, start);
    CHECK(part.names.size() == 3);
    CHECK(part.more);
    request.after = part.names.back().path;
    part = names.list(request, start);
    CHECK(part.names.size() == 2);
    CHECK_FALSE(part.more);
}

TEST_CASE("registry: a list is told in parts of max_listed_bytes, and each has a name at least") {
    ise::registry_limits limits;
    limits.max_listed_bytes = 40'000;
    ise::registry names(options(limits), 1, start, noon);
    for (int i = 0; i < 5; ++i) {
        auto request = request_of(1, fmt::format("c{}", i));
        const std::size_t endpoints = i == 3 ? 64 : 30; // of 512 bytes each
        for (std::size_t n = 0; n < endpoints; ++n) request.components[0].endpoints.emplace_back(512, 'e');
        REQUIRE(names.enroll(request, start).grants.at(0).what == verdict::granted);
    }
    ise::naming::list_request request;
    std::vector<std::size_t> parts;
    for (bool more = true; more;) {
        auto part = names.list(request, start);
        parts.push_back(part.names.size());
        request.after = part.names.back().path;
        more = part.more;
    }
    CHECK(parts == std::vector<std::size_t>{3, 2});
}

TEST_CASE("registry: of names that nobody holds max_remembered keep their epoch, and the others get a higher one") {
    ise::registry_limits limits;
    limits.max_remembered = 2;
    ise::registry names(options(limits), 1, start, noon);
    auto now = start;
    std::map<std::string, std::uint64_t> epochs, proofs;
    for (std::uint64_t node = 1; node <= 4; ++node) {
        auto path = fmt::format("c{}", node);
        auto granted = names.enroll(request_of(node, path), now).grants.at(0);
        epochs[path] = granted.epoch;
        proofs[path] = granted.proof;
    }
    for (auto end = now + 5s; now < end; names.advance(now)) now += names.tick();
    REQUIRE(names.components() == 0);
    int kept = 0;
    for (std::uint64_t node = 1; node <= 4; ++node) {
        auto path = fmt::format("c{}", node);
        auto request = request_of(node, path, epochs[path]);
        request.components.front().proof = proofs[path];
        auto back = names.enroll(request, now).grants.at(0);
        REQUIRE(back.what == verdict::granted);
        CHECK(back.epoch >= epochs[path]);
        kept += back.epoch == epochs[path];
    }
    CHECK(kept == 2);
}

} // namespace registry_limits_test
