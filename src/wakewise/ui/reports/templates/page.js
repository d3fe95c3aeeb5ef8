"use strict";
(() => {
  // The scene waits until it is nearly in sight: it takes the graphics card.
  for (const box of document.querySelectorAll(".scene")) {
    const store = box.querySelector("script[type='application/json']");
    const frame = box.querySelector("iframe");
    if (!store || !frame) continue;
    const stage = box.querySelector(".stage");
    // The scene unpacks itself for seconds after it is loaded; until it draws, its place holds a picture.
    const unveil = (tries) => {
      const page = frame.contentDocument;
      if ((page && page.querySelector("canvas")) || !tries) setTimeout(() => stage.classList.add("drawn"), 700);
      else setTimeout(() => unveil(tries - 1), 200);
    };
    const open = () => {
      frame.srcdoc = JSON.parse(store.textContent);
      frame.addEventListener("load", () => unveil(150), { once: true });
      store.remove();
    };
    if (!("IntersectionObserver" in window)) { open(); continue; }
    const near = new IntersectionObserver((seen) => {
      if (seen.some((entry) => entry.isIntersecting)) { near.disconnect(); open(); }
    }, { rootMargin: "300px" });
    near.observe(box);
  }

  // Long tables begin folded, and on a phone all long parts but the first photographs.
  const phone = matchMedia("screen and (max-width: 720px)").matches;
  document.querySelectorAll("details.fold").forEach((part, i) => {
    part.open = part.open && !!part.querySelector(".photo") && (i === 0 || !phone);
  });

  const loupe = document.getElementById("loupe");
  const shots = [...document.querySelectorAll(".photo:not(.gone)")];
  let at = 0;
  const show = (i) => {
    at = (i + shots.length) % shots.length;
    const image = shots[at].querySelector("img");
    loupe.querySelector("img").src = image.src;
    loupe.querySelector("img").alt = image.alt;
    loupe.querySelector("p").textContent = shots[at].dataset.facts;
  };
  shots.forEach((shot, i) => shot.addEventListener("click", () => { show(i); loupe.showModal(); }));
  loupe.addEventListener("click", (event) => {
    const go = event.target.dataset ? event.target.dataset.go : undefined;
    if (go === "0" || event.target === loupe) loupe.close();
    else if (go) show(at + Number(go));
  });
  loupe.addEventListener("keydown", (event) => {
    if (event.key === "ArrowRight") show(at + 1);
    if (event.key === "ArrowLeft") show(at - 1);
  });

  const links = [...document.querySelectorAll("nav.parts a")];
  if (links.length && "IntersectionObserver" in window) {
    const watch = new IntersectionObserver((seen) => {
      for (const entry of seen) {
        if (!entry.isIntersecting) continue;
        links.forEach((a) => a.classList.toggle("here", a.hash === "#" + entry.target.id));
      }
    }, { rootMargin: "-30% 0px -60% 0px" });
    document.querySelectorAll("main section[id]").forEach((section) => watch.observe(section));
  }
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
})();
