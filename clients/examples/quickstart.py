"""Post scans round a block, then localize a device."""

from homsense_client import Client

URL = globals().get("URL", "http://127.0.0.1:8080")
RING = [[0, 0], [30, 0], [30, 30], [0, 30], [0, 0]]
MAP = {"type": "Polygon", "coordinates": [RING], "frame": "local"}
SEEN = [["cafe", "bank"], ["bank", "gym"], ["gym", "shop"], ["shop", "cafe"]]

with Client(URL) as client:
    client.put_site("block", s_max_m=40.0, hops=[1, 2], landmark_key="ssid")
    client.put_map("block", MAP)
    client.post_scans(
        "block",
        [
            {"device": "phone", "scan_id": str(n), "observed_at": 1.7e9 + n, "landmarks": names}
            for n, names in enumerate(SEEN)
        ],
    )
    print("holes:", client.get_complex("block").betti[1])
    with client.open_session("block", seed=1) as session:
        pose = session.step({"forward_m": 5.0}, ["cafe", "bank"])
        print(pose.status, pose.holes, round(pose.best.x_m), round(pose.best.y_m))
    client.delete_site("block")
