#pragma once
#include <components/web_server/tile_source.hpp>
#include <components/web_server/track_state.hpp>
#include <ise/http/http_server.hpp>

#include <functional>
#include <string>

namespace atirma {

/// What the page is given besides the state of its boat.
struct page_extras {
    std::function<std::string()> boats; ///< the list of all boats as JSON; none by default
    tile_source tiles;
};

/// Serves index.html as the page of the boat with that address; empty: as the first page, "/". The browser is told to
/// ask for the newest reports while it still loads the scripts.
void offer_page(ise::http_server& server, const std::string& id);

/// Serves `PREFIX/now.json`, the newest reports, which the page shows first, and `PREFIX/track.json`, the whole track,
/// compressed, made anew every ten seconds at most and shared by all viewers. The page's event stream goes on from
/// there. `state` outlives the server.
void offer_page_data(ise::http_server& server, const std::string& prefix, const track_state& state,
                     std::function<utc_ms()> clock, page_extras extras = page_extras());

} // namespace atirma
