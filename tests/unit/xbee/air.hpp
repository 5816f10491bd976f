#pragma once
#include <components/xbee/ether.hpp>
#include <components/xbee/radio_client.hpp>

#include <algorithm>
#include <functional>
#include <memory>

/// Stations on one ether: a modem, and a client on its serial line.
struct station {
    std::unique_ptr<atirma::xbee::modem> device;
    atirma::xbee::radio_client client;
    std::vector<atirma::xbee::client_event> events;
    bool plugged = true;

    template <class E>
    std::vector<E> all() const {
        std::vector<E> out;
        for (auto& e : events)
            if (auto* one = std::get_if<E>(&e)) out.push_back(*one);
        return out;
    }
};

struct air {
    explicit air(atirma::xbee::ether_options options = {}) : ether(options) {}

    station& add(std::uint64_t address, double x_m, std::uint8_t ap = 1, atirma::xbee::client_options options = {}) {
        atirma::xbee::modem_options m;
        m.address = address;
        m.api_mode = ap;
        stations.push_back(std::make_unique<station>());
        auto& s = *stations.back();
        s.device = std::make_unique<atirma::xbee::modem>(m);
        s.client = atirma::xbee::radio_client(options);
        ether.attach(*s.device, {x_m, 0});
        s.client.start(now);
        return s;
    }

    /// Lets bytes and time flow until `until`; every event is handled at its own time.
    void run(atirma::xbee::instant until) {
        for (;;) {
            exchange();
            auto next = ether.next_event();
            for (auto& s : stations) next = std::min(next, s->client.next_event());
            if (next > until) break;
            now = std::max(now, next);
            ether.advance(now);
            for (auto& s : stations) s->client.on_time(now);
        }
        now = until;
    }
    void exchange() {
        for (bool again = true; again;) {
            again = false;
            for (auto& s : stations) {
                auto down = s->client.take_output(), up = s->device->take_serial();
                again |= !down.empty() || !up.empty();
                if (s->plugged) {
                    s->device->on_serial(now, down);
                    s->client.on_bytes(now, up);
                }
                while (auto e = s->client.take_event()) s->events.push_back(*e);
            }
            ether.advance(now);
        }
    }

    atirma::xbee::instant now{0};
    atirma::xbee::ether ether;
    std::vector<std::unique_ptr<station>> stations;
};
