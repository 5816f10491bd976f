// The two ends of a sealed channel, each of which gets flights, sealed datagrams and signs that are changed as the
// input says: whatever comes, nothing counts that the other end has not made, and true datagrams are taken as before.
// The first byte chooses how the two know each other: by the shared key or by certificates.
// link: OpenSSL::Crypto
// source: tests/support/authority.cpp
#include <fuzz/input.hpp>
#include <ise/core/buffer.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/identity.hpp>
#include <ise/transport/udp/seal.hpp>
#include <ise/wire/datagram.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/sealed_datagram.hpp>
#include <support/authority.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

using ise::net::udp::key_life;
using ise::net::udp::seal;

namespace {

void must(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "sealed_channel: %s\n", what);
    std::abort();
}

// Another text of the same kind.
ise::bytes changed(fuzz_input& by, ise::bytes from, std::size_t begin) {
    switch (by.next() % 4) {
        case 0: {
            auto content = by.raw(by.next());
            from.resize(std::min(from.size(), begin));
            from.insert(from.end(), content.begin(), content.end());
            break;
        }
        case 1:
            if (from.size() > begin)
                from[begin + (by.next() * 256u + by.next()) % (from.size() - begin)] ^= std::byte{by.next()};
            break;
        case 2: from.resize(begin + (from.size() - begin) * by.next() / 256); break;
        default: from.push_back(std::byte{by.next()});
    }
    return from;
}

/// Makes ends by certificates, of hosts on the virtual clock.
class certified {
public:
    std::unique_ptr<seal> make(bool calls, key_life life) {
        auto& of = calls ? shore_ : boat_;
        return seal::make(of.identity, *of.env, calls ? "boat" : "", life);
    }

private:
    struct side {
        ise::environment* env;
        std::shared_ptr<ise::net::tls::identity> identity;
    };
    side on(const std::string& name) {
        auto& host = world_.host(name);
        auto& process = host.start_process(name);
        auto folder = signer_.issue(name);
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            host.write_file(std::string("tls/") + file, ise_test::read_all(folder / file));
        return {&process, ise::net::tls::identity::load(process, "tls").value()};
    }

    ise::sim::world world_{1};
    ise_test::authority signer_;
    side shore_ = on("shore"), boat_ = on("boat");
};

std::vector<ise::bytes> flight_of(const seal& of) { return {of.flight().begin(), of.flight().end()}; }

ise::bytes made_by(seal& by, std::uint64_t number) {
    ise::buffer out;
    ise::wire::data_writer writer(out, 77, number);
    out.grow(ise::wire::sealed::seal_bytes);
    writer.put(ise::wire::chunk_type::probe, number);
    writer.finish();
    by.close(out, number, ise::time_point{});
    return out.to_bytes();
}

// As a port does before.
bool opens(seal& by, ise::bytes datagram) {
    if (datagram.size() < ise::wire::frame_header::size) return false;
    ise::detail::store_little(datagram.data(),
                              static_cast<std::uint32_t>(datagram.size() - ise::wire::frame_header::size));
    auto view = ise::wire::read_datagram(datagram);
    return view && view->type == ise::wire::sealed::data && by.open(datagram).has_value();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 2 || size > 4096) return 0;
    fuzz_input input{ise::bytes_view(reinterpret_cast<const std::byte*>(data), size)};
    static const auto key = ise::shared_key::make(std::string(64, 'k'), "a test").value();
    static certified ends;
    bool certificates = input.next() % 2 == 1;
    auto make = [&](bool calls, key_life life) {
        return certificates ? ends.make(calls, life) : seal::make(key, calls, life);
    };
    key_life life;
    life.datagrams = 4;
    auto hear = [](seal& by, const seal& of) {
        for (const auto& part : flight_of(of)) by.take_flight(part);
    };
    // What TLS ignores may differ: the versions in the heads of its unencrypted records, and bytes behind the last
    // record.
    auto check_of_two = [](seal& called, seal& caller) {
        if (!called.sealed()) return;
        must(caller.sealed(), "the side that was called has a session alone");
        must(opens(called, made_by(caller, 0)), "two sessions of one handshake");
    };
    { // Changed flights, to each end: where there is a session nevertheless, it is that of the two.
        auto caller = make(true, life), called = make(false, life);
        for (int at = input.next() % 8; at > 0; --at) {
            auto flight = flight_of(*caller);
            auto bad = changed(input, flight.empty() ? ise::bytes(3) : flight.front(), 0);
            if (!flight.empty() && bad == flight.front()) continue;
            if (called->take_flight(bad))
                for (const auto& part : flight_of(*called)) caller->take_flight(changed(input, part, 3));
        }
        check_of_two(*called, *caller);
    }
    { // One part of a true handshake is changed.
        auto caller = make(true, life), called = make(false, life);
        int bad = input.next() % 8, part_number = 0;
        auto hear_one_changed = [&](seal& by, const seal& of) {
            for (const auto& part : flight_of(of))
                by.take_flight(part_number++ == bad ? changed(input, part, input.next() % 4) : part);
        };
        for (int turn = 0; turn < 2; ++turn) {
            hear_one_changed(*called, *caller);
            hear_one_changed(*caller, *called);
        }
        check_of_two(*called, *caller);
    }
    auto caller = make(true, life), called = make(false, life);
    hear(*called, *caller);
    hear(*caller, *called);
    hear(*called, *caller);
    must(caller->sealed() && called->sealed(), "no session of true flights");
    std::uint64_t number = 0;
    while (!input.left.empty() && number < 200) {
        auto good = made_by(*caller, number);
        auto bad = changed(input, good, input.next() % 2 == 0 ? 4 : ise::wire::data_head_bytes);
        auto back = bad;
        ise::detail::store_little(back.data(), ise::detail::load_little<std::uint32_t>(good.data()));
        if (back != good) must(!opens(*called, bad), "a changed datagram was opened");
        caller->take_flight(bad); // an alert that nobody made
        must(!caller->trouble(), "an invented alert was believed");
        ise::buffer sign;
        caller->put_sign(sign, 77);
        auto odd = changed(input, sign.to_bytes(), ise::wire::frame_header::size);
        if (odd != sign.to_bytes()) must(!called->take_sign(odd), "a changed sign was taken");
        must(opens(*called, good), "a true datagram was not opened");
        must(called->take_sign(sign.view()), "a true sign was not taken");
        ++number;
    }
    return 0;
}
